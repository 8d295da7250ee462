#include "tileflight/evaluation/scoring/receiver_truth.h"

#include <algorithm>
#include <cmath>
#include <string_view>

#include "tileflight/capture/ingest/ingest_stage.h"
#include "tileflight/capture/ingest/telemetry_offset.h"
#include "tileflight/capture/ingest/telemetry_positions.h"
#include "tileflight/core/base/file_kind.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/order_statistics.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/core/geometry/geodesy.h"
#include "tileflight/data/dataset/dataset.h"
#include "tileflight/data/flight_logs/photo_log.h"
#include "tileflight/evaluation/scoring/localize_stage.h"

namespace tileflight::scoring {
namespace fs = std::filesystem;
namespace {

using geometry::Trajectory;
using geometry::Vec3;

/// Files of poses are text: numbers alone, or below a heading that names no latitude.
bool is_flight_log(const fs::path& file) {
  const std::string head = base::read_head(file);
  if (head.find('\0') != std::string::npos) return true;
  const std::string_view text = base::trim(base::strip_byte_order_mark(head));
  if (text.starts_with('<') || text.starts_with('$')) return true;
  const std::string_view first = base::trim(text.substr(0, text.find('\n')));
  if (!first.empty() && std::ranges::all_of(first, base::is_digit)) return true;  // the number of a subtitle
  return base::to_lower(std::string(text)).find("latitude") != std::string::npos ||
         base::to_lower(std::string(first)).find("lat") != std::string::npos;
}

std::vector<alignment::PositionFix> local_fixes(const std::vector<dataset::GpsFix>& gps) {
  const std::vector<Vec3> positions = ingest::to_local_positions(gps, geometry::LocalFrame(gps.front().position));
  std::vector<alignment::PositionFix> fixes;
  for (std::size_t i = 0; i < gps.size(); ++i)
    fixes.push_back({gps[i].time_s, positions[i], gps[i].horizontal_sigma_m, gps[i].vertical_sigma_m});
  return fixes;
}

/// The datum of the heights does not matter: the alignment moves the estimate to them.
ingest::IngestedFlightConfig heights_as_they_are(const flight_logs::Telemetry& telemetry) {
  ingest::IngestedFlightConfig flight;
  const bool has_absolute = std::ranges::any_of(
      telemetry.fixes, [](const flight_logs::TelemetryFix& fix) { return fix.absolute_height_m.has_value(); });
  if (!has_absolute) {
    flight.telemetry_height = "takeoff";
    flight.takeoff_height_m = 0.0;
  } else if (telemetry.height_datum == flight_logs::HeightDatum::kUnknown) {
    flight.telemetry_height = "ellipsoid";
  }
  return flight;
}

ReceiverTruth read_log(const fs::path& file) {
  ReceiverTruth truth;
  truth.telemetry = ingest::read_flight_log(file);
  truth.warnings = truth.telemetry.warnings;
  truth.has_own_sigmas =
      std::ranges::any_of(truth.telemetry.fixes, [](const auto& fix) { return fix.horizontal_sigma_m.has_value(); });
  ingest::IngestedFlightConfig flight = heights_as_they_are(truth.telemetry);
  flight.telemetry = file;
  truth.fixes = local_fixes(ingest::to_gps_fixes(truth.telemetry, flight, truth.warnings));
  return truth;
}

/// The antenna's path: the lever arm is given in metres, the estimate has its own unit.
Trajectory antenna_path(Trajectory camera, const Vec3& lever_arm) {
  for (geometry::StampedPose& pose : camera.poses)
    pose.T_local_camera.translation += pose.T_local_camera.rotation * lever_arm;
  return camera;
}

Trajectory shifted(Trajectory trajectory, double offset_s) {
  for (geometry::StampedPose& pose : trajectory.poses) pose.time_s += offset_s;
  return trajectory;
}

/// A path is taken as straight between poses that are no farther apart: the acceleration of a drone, up to 5 m/s^2,
/// bends it by 0.16 m in this time.
constexpr double kStraight_s = 0.5;

/// Returns the time between the poses from which the estimate's position at a time is interpolated; 0 at a pose.
/// nullopt outside its times.
std::optional<double> interpolated_over_s(const Trajectory& estimate, double time_s) {
  constexpr double kSameTime_s = 0.005;
  const auto after = std::ranges::lower_bound(estimate.poses, time_s, {}, &geometry::StampedPose::time_s);
  if (after == estimate.poses.end() || (after == estimate.poses.begin() && after->time_s > time_s)) return std::nullopt;
  if (after->time_s - time_s < kSameTime_s) return 0.0;
  const auto before = std::prev(after);
  return time_s - before->time_s < kSameTime_s ? 0.0 : after->time_s - before->time_s;
}

/// Returns the fixes for which the estimate is interpolated over no longer a time, repeated positions once.
std::vector<alignment::PositionFix> fixes_within(const std::vector<alignment::PositionFix>& fixes,
                                                 const Trajectory& estimate, double most_s) {
  std::vector<alignment::PositionFix> usable;
  const alignment::PositionFix* before = nullptr;
  for (const alignment::PositionFix& fix : fixes) {
    const bool is_held = before != nullptr && fix.position == before->position;
    before = &fix;
    const std::optional<double> over_s = interpolated_over_s(estimate, fix.time_s);
    if (!is_held && over_s && *over_s <= most_s) usable.push_back(fix);
  }
  return usable;
}

/// Returns the fixes at poses or between close ones; only where there are none of these, those between poses at their
/// usual distance in time.
std::vector<alignment::PositionFix> usable_fixes(const std::vector<alignment::PositionFix>& fixes,
                                                 const Trajectory& estimate) {
  constexpr double kTimesUsual = 1.5;
  std::vector<alignment::PositionFix> usable = fixes_within(fixes, estimate, kStraight_s);
  if (usable.size() >= 3) return usable;
  std::vector<double> intervals_s;
  for (std::size_t i = 1; i < estimate.size(); ++i)
    intervals_s.push_back(estimate.poses[i].time_s - estimate.poses[i - 1].time_s);
  return fixes_within(fixes, estimate, kTimesUsual * base::median(intervals_s));
}

/// Returns a warning if the estimate was interpolated over a time in which its path may have bent.
Warnings interpolation_warnings(const std::vector<alignment::PositionFix>& fixes, const Trajectory& estimate,
                                const std::string& name) {
  double longest_s = 0.0;
  for (const alignment::PositionFix& fix : fixes)
    longest_s = std::max(longest_s, interpolated_over_s(estimate, fix.time_s).value_or(0.0));
  if (longest_s <= kStraight_s) return {};
  return {{base::formatted("the receiver's positions lie between poses up to %.1f s apart, between which the path is "
                           "taken as straight: its bends are in the error",
                           longest_s),
           name, Severity::kWarning, "give positions at the times of the images"}};
}

alignment::TrajectoryAlignment align(const Trajectory& estimate, const std::vector<alignment::PositionFix>& fixes,
                                     const ReceiverScoring& scoring, alignment::AlignTrajectoryOptions options) {
  alignment::TrajectoryAlignment aligned = alignment::align_trajectory(estimate, fixes, options);
  if (scoring.lever_arm_m.isZero()) return aligned;
  constexpr int kSteps = 5;  // the scale changes by the lever arm's share of the path, each time less
  for (int step = 0; step < kSteps; ++step)
    aligned = alignment::align_trajectory(antenna_path(estimate, scoring.lever_arm_m / aligned.T_local_map.scale),
                                          fixes, options);
  return aligned;
}

/// Returns the offset by the motion that both clocks saw. Throws InputError if the motion does not determine it.
double coarse_offset_s(const Trajectory& estimate, const ReceiverTruth& truth) {
  if (truth.telemetry.fixes.empty()) return 0.0;  // a dataset has one clock
  const ingest::TelemetryOffset found = ingest::estimate_telemetry_offset(estimate, truth.telemetry);
  if (!found.offset.determined)
    throw InputError("--time-offset", "auto: the motion does not determine the offset of the clocks (" +
                                          found.offset.reason + "); give it in seconds");
  return -found.offset.offset_s;
}

void add_errors(const std::vector<alignment::PositionFix>& fixes, ReceiverScore& score) {
  double horizontal = 0.0, vertical = 0.0, squared = 0.0, normalized = 0.0;
  std::size_t axes = 0;
  const auto n = static_cast<double>(fixes.size());
  for (std::size_t i = 0; i < fixes.size(); ++i) {
    const Vec3 error = score.poses.estimate.poses[i].T_local_camera.translation - fixes[i].position;
    const double h = fixes[i].horizontal_sigma_m, v = fixes[i].vertical_sigma_m;
    horizontal += h * h / n;
    vertical += v * v / n;
    squared += error.squaredNorm() / n;
    if (!(h > 0.0) || !(v > 0.0)) continue;
    normalized += error.head<2>().squaredNorm() / (h * h) + error.z() * error.z() / (v * v);
    axes += 3;
  }
  score.receiver.horizontal_sigma_m = std::sqrt(horizontal);
  score.receiver.vertical_sigma_m = std::sqrt(vertical);
  score.receiver.expected_rmse_m = std::sqrt(2.0 * horizontal + vertical);
  if (axes > 0) score.receiver.normalized_error_squared = normalized / static_cast<double>(axes);
  const double beyond = squared - 2.0 * horizontal - vertical;
  if (beyond > 0.0) score.receiver.beyond_receiver_m = std::sqrt(beyond);
}

void add_warnings(const std::vector<alignment::PositionFix>& fixes, const ReceiverTruth& truth,
                  const alignment::TrajectoryAlignment& aligned, const ReceiverScoring& scoring,
                  const std::string& name, ReceiverScore& score) {
  const std::string own = base::formatted(
      "%s with standard deviations of %.3g m (level) and %.3g m (height%s) give a perfect trajectory an error of "
      "%.3g m; ",
      truth.what.c_str(), score.receiver.horizontal_sigma_m, score.receiver.vertical_sigma_m,
      truth.has_own_sigmas ? "" : "; assumed, the log states none", score.receiver.expected_rmse_m);
  const std::string rest =
      score.receiver.beyond_receiver_m
          ? base::formatted("of this trajectory's, %.3g m are beyond that", *score.receiver.beyond_receiver_m)
          : "this trajectory's is not larger, so that nothing of it is shown to be the trajectory's";
  if (score.receiver.expected_rmse_m > 0.0)
    score.warnings.push_back({own + rest, name, Severity::kNote,
                              "slow errors of these positions are taken up by the alignment and in no number"});
  if (!aligned.note.empty())
    score.warnings.push_back({aligned.note, name, Severity::kWarning, "check the log and the trajectory's times"});
  if (aligned.inliers < aligned.pairs)
    score.warnings.push_back({std::to_string(aligned.pairs - aligned.inliers) + " of " + std::to_string(aligned.pairs) +
                                  " positions do not fit the alignment, but count in the errors",
                              name, Severity::kNote, "look at trajectory-errors.json for where they are"});
  if (!scoring.time_offset_s) return;
  constexpr double kLeast_s = 0.05, kSigmas = 4.0;
  alignment::AlignTrajectoryOptions free;
  try {
    const alignment::TrajectoryAlignment moved = alignment::align_trajectory(score.poses.estimate, fixes, free);
    if (std::abs(moved.time_offset_s) > std::max(kLeast_s, kSigmas * moved.time_offset_sigma_s) &&
        moved.rmse_m < 0.8 * aligned.rmse_m)
      score.warnings.push_back(
          {base::formatted("the positions fit better (%.3g m instead of %.3g m) if the receiver's clock is %.2f s off",
                           moved.rmse_m, aligned.rmse_m, moved.time_offset_s),
           name, Severity::kWarning,
           base::formatted("give the offset of the clocks: `telemetry_offset` of the flight, or `evaluate "
                           "--time-offset %.2f`",
                           score.receiver.time_offset_s - moved.time_offset_s)});
  } catch (const InputError&) {  // too short a flight to tell
  }
}

}  // namespace

std::optional<ReceiverTruth> read_receiver_truth(const fs::path& file) {
  if (!fs::is_directory(file)) return is_flight_log(file) ? std::optional(read_log(file)) : std::nullopt;
  if (fs::exists(file / "localize.json"))
    return ReceiverTruth{.what = "positions located in the tiles", .fixes = read_located_positions(file)};
  if (!flight_logs::read_photo_log(file).telemetry.fixes.empty()) return read_log(file);
  const dataset::Dataset dataset = dataset::read_dataset(file);
  if (dataset.groundtruth) return std::nullopt;
  if (dataset.gps.empty()) throw InputError(file.string(), "the dataset has neither true poses nor positions");
  return ReceiverTruth{.fixes = local_fixes(dataset.gps), .telemetry = {}, .warnings = dataset.warnings};
}

ReceiverScore score_by_receiver(const Trajectory& estimate, const ReceiverTruth& truth,
                                metrics::TrajectoryAlignment alignment, const ReceiverScoring& scoring,
                                const std::string& name) {
  if (alignment == metrics::TrajectoryAlignment::kNone)
    throw InputError("--alignment", "none: a receiver's positions are in no frame of the estimate; use sim3 or se3");
  if (estimate.size() < 3) throw InputError(name, "has fewer than three poses");
  if (truth.fixes.size() < 3)
    throw InputError(name, "is compared with " + std::to_string(truth.fixes.size()) +
                               " positions of a receiver; give a log with at least three");
  alignment::AlignTrajectoryOptions options;
  options.scale = alignment == metrics::TrajectoryAlignment::kSim3 ? alignment::ScaleMode::kEstimated
                                                                   : alignment::ScaleMode::kFixed;
  options.estimate_time_offset = !scoring.time_offset_s;
  ReceiverScore score;
  score.receiver.lever_arm_m = scoring.lever_arm_m;
  score.receiver.time_offset_s = scoring.time_offset_s ? *scoring.time_offset_s : coarse_offset_s(estimate, truth);
  Trajectory on_clock = shifted(estimate, score.receiver.time_offset_s);
  std::vector<alignment::PositionFix> fixes = usable_fixes(truth.fixes, on_clock);
  if (fixes.size() < 3)
    throw InputError(
        name, base::formatted("%zu of the receiver's %zu positions lie within its times (%.3f to %.3f s, "
                              "the receiver's %.3f to %.3f s): give --time-offset S, or auto",
                              fixes.size(), truth.fixes.size(), on_clock.poses.front().time_s,
                              on_clock.poses.back().time_s, truth.fixes.front().time_s, truth.fixes.back().time_s));
  alignment::TrajectoryAlignment aligned = align(on_clock, fixes, scoring, options);
  if (options.estimate_time_offset) {
    score.receiver.time_offset_s -= aligned.time_offset_s;
    score.receiver.time_offset_sigma_s = aligned.time_offset_sigma_s;
    on_clock = shifted(estimate, score.receiver.time_offset_s);
    fixes = usable_fixes(truth.fixes, on_clock);
    options.estimate_time_offset = false;
    aligned = align(on_clock, fixes, scoring, options);
  }
  const Trajectory antenna = geometry::transformed(
      aligned.T_local_map, antenna_path(on_clock, scoring.lever_arm_m / aligned.T_local_map.scale));
  for (const alignment::PositionFix& fix : fixes) {
    const geometry::SE3 pose = geometry::interpolate(antenna, fix.time_s).value();
    score.poses.estimate.poses.push_back({fix.time_s, pose});
    score.poses.truth.poses.push_back({fix.time_s, {pose.rotation, fix.position}});
  }
  score.poses.estimated_poses = estimate.size();
  score.poses.true_poses = truth.fixes.size();
  score.poses.true_duration_s = truth.fixes.back().time_s - truth.fixes.front().time_s;
  Trajectory recorded;
  for (const alignment::PositionFix& fix : truth.fixes) recorded.poses.push_back({fix.time_s, {}});
  score.poses.unrecorded = metrics::find_time_gaps(recorded, score.poses.true_duration_s);
  score.poses.T_truth_estimate = aligned.T_local_map;
  score.warnings = interpolation_warnings(fixes, on_clock, name);
  add_errors(fixes, score);
  add_warnings(fixes, truth, aligned, scoring, name, score);
  return score;
}

metrics::TrajectoryMetrics score_trajectory(const ReceiverScore& score, const metrics::TrajectoryOptions& options) {
  metrics::TrajectoryMetrics metrics = metrics::score_trajectory(score.poses, options);
  metrics.receiver = score.receiver;
  return metrics;
}

std::optional<metrics::TrajectoryMetrics> score_by_recorded_positions(const Trajectory& estimate,
                                                                      const fs::path& dataset, Warnings& warnings) {
  const std::string where = "trajectory";
  try {
    const std::optional<ReceiverTruth> truth = read_receiver_truth(dataset);
    if (!truth) return std::nullopt;
    const metrics::TrajectoryOptions options;
    ReceiverScore score = score_by_receiver(estimate, *truth, options.alignment,
                                            {.time_offset_s = 0.0, .lever_arm_m = Vec3::Zero()}, where);
    warnings.insert(warnings.end(), score.warnings.begin(), score.warnings.end());
    return score_trajectory(score, options);
  } catch (const InputError& fault) {
    warnings.push_back({std::string("the path is not compared with the recorded positions: ") + fault.what(), where,
                        Severity::kWarning, ""});
    return std::nullopt;
  }
}

}  // namespace tileflight::scoring
