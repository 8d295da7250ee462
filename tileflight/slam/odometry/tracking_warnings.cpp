#include "tileflight/slam/odometry/tracking_warnings.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>

#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/order_statistics.h"

namespace tileflight::odometry {
namespace {

constexpr const char* kWhere = "odometry";
using FrameName = std::function<std::string(std::int64_t)>;

std::string percent_text(double share) { return base::formatted("%.2g %%", 100.0 * share); }

std::string count_text(std::int64_t number) { return std::to_string(number); }

/// "frame 000012" or "frames 000012 to 000019".
std::string frames_text(const tracking::FrameQuality& first, const tracking::FrameQuality& last,
                        const FrameName& name_of) {
  const std::string from = name_of(first.frame), to = name_of(last.frame);
  return from == to ? "frame " + from : "frames " + from + " to " + to;
}

/// Images without a pose. Tracking goes on only in the same map, so the others' poses and points are as good as without
/// the gap: where few are missing, the result is only smaller.
void check_completeness(const OdometryResult& result, std::int64_t frames, const WarningThresholds& limits,
                        Warnings& warnings) {
  const std::string share = count_text(result.frames_tracked) + " of " + count_text(frames) + " frames have a pose";
  const auto given = static_cast<double>(frames);
  const double missing = given - static_cast<double>(result.frames_tracked);
  if (result.lost) {
    const std::string end = result.frames_tracked == 0 ? "the flight was not tracked ("
                            : result.backwards         ? "the flight was not tracked back to its beginning ("
                                                       : "the flight was not tracked to its end (";
    warnings.push_back({end + share + "): " + result.lost_reason, kWhere, Severity::kError,
                        !result.lost_remedy.empty()                 ? result.lost_remedy
                        : result.frames_tracked < limits.min_frames ? "use a flight that can be tracked throughout"
                                                                    : "use the tracked part, or a flight that can be "
                                                                      "tracked throughout"});
  } else if (static_cast<double>(result.frames_tracked) < limits.min_tracked_share * given) {
    warnings.push_back({share, kWhere, missing > limits.few_missing_share * given ? Severity::kError : Severity::kNote,
                        "look up the frames without a pose in quality.csv; choose another part of the flight"});
  }
}

void check_length(const OdometryResult& result, const WarningThresholds& limits, Warnings& warnings) {
  if (result.frames_tracked >= limits.min_frames) return;
  warnings.push_back(
      {"only " + count_text(result.frames_tracked) + " frames have a pose: too few to judge the tracking quality",
       kWhere, Severity::kWarning,
       result.lost ? "use a flight of which a longer part can be tracked" : "use a longer part of the flight"});
}

/// Reports the images with a large share of saturated residuals, from the first to the last. A few that still align by
/// most of their points are a small part of the flight.
void check_residuals(const OdometryResult& result, const FrameName& name_of, const WarningThresholds& limits,
                     Warnings& warnings) {
  const tracking::FrameQuality *first = nullptr, *last = nullptr;
  int bad = 0;
  double worst = 0.0;
  for (const tracking::FrameQuality& q : result.quality) {
    if (!q.tracked || q.saturated_share <= limits.saturated_share) continue;
    if (first == nullptr) first = &q;
    last = &q;
    ++bad;
    worst = std::max(worst, q.saturated_share);
  }
  if (bad == 0) return;
  const bool is_small = worst <= limits.saturated_likely_share &&
                        bad <= limits.saturated_likely_frames * static_cast<double>(result.frames_tracked);
  warnings.push_back(
      {"tracking residuals are high in " + count_text(bad) + " frames: up to " + percent_text(worst) +
           " of the points do not match their keyframe",
       std::string(kWhere) + ", " + frames_text(*first, *last, name_of),
       is_small ? Severity::kNote : Severity::kWarning,
       "check these frames for blur, an obstruction in front of the lens or rotation in place; leave them out"});
}

bool has_metric_scale(const OdometryResult& result) { return result.stereo && result.stereo->metric; }

void check_metric_scale(const OdometryResult& result, const WarningThresholds& limits, Warnings& warnings) {
  if (!has_metric_scale(result)) return;
  std::vector<double> sigmas;
  for (const tracking::FrameQuality& q : result.quality) {
    if (q.tracked) sigmas.push_back(q.sigma_log_scale);
  }
  if (sigmas.empty()) return;
  const double sigma = base::median(sigmas);
  if (sigma <= limits.sigma_metric_scale) return;
  warnings.push_back({"the scale is known to " + percent_text(sigma) +
                          " only (one sigma): what the cameras see is too far away for the distance between them",
                      kWhere, Severity::kWarning, "use cameras further apart, or fly lower"});
}

void check_scale_drift(const OdometryResult& result, const FrameName& name_of, const WarningThresholds& limits,
                       Warnings& warnings) {
  if (has_metric_scale(result)) return;
  const auto beyond = [&](const tracking::FrameQuality& q) {
    return q.tracked && q.sigma_log_scale > limits.sigma_log_scale;
  };
  // The deviation grows away from the start, in both directions.
  const auto start = result.backwards ? result.quality.end() - result.frames_before_start
                                      : result.quality.begin() + result.frames_before_start;
  const auto first = std::find_if(start, result.quality.end(), beyond);
  const auto last = std::find_if(std::make_reverse_iterator(start), result.quality.rend(), beyond);
  std::string where;
  if (last != result.quality.rend()) where = "up to " + frames_text(*last, *last, name_of);
  if (first != result.quality.end())
    where += (where.empty() ? "from " : " and from ") + frames_text(*first, *first, name_of) + " on";
  if (where.empty()) return;
  double end = 0.0;
  for (const tracking::FrameQuality& q : result.quality) end = std::max(end, q.sigma_log_scale);
  warnings.push_back({"the scale may have drifted: few points or little parallax constrained it (at least " +
                          percent_text(end) + " by the residuals alone)",
                      std::string(kWhere) + ", " + where, Severity::kWarning,
                      "keep moving while turning, or use only the other part"});
}

/// Reports velocity changes that last for one image only, relative to the flight's 95th percentile of speed.
void check_jumps(const OdometryResult& result, const FrameName& name_of, const WarningThresholds& limits,
                 Warnings& warnings) {
  const auto& poses = result.trajectory.poses;
  if (poses.size() < 4) return;
  std::vector<geometry::Vec3> velocity;
  std::vector<double> speed;
  for (std::size_t i = 1; i < poses.size(); ++i) {
    velocity.push_back((poses[i].T_local_camera.translation - poses[i - 1].T_local_camera.translation) /
                       (poses[i].time_s - poses[i - 1].time_s));
    speed.push_back(velocity.back().norm());
  }
  std::vector<double> sorted = speed;
  std::sort(sorted.begin(), sorted.end());
  const double usual = sorted[(sorted.size() - 1) * 95 / 100];
  // A jump changes the velocity and changes it back (away and back, or a step sideways). A change of speed alone is not
  // one.
  const auto changes = [&](std::size_t i) {
    return std::min((velocity[i] - velocity[i - 1]).norm(), (velocity[i + 1] - velocity[i]).norm());
  };
  std::size_t worst = 1;
  for (std::size_t i = 1; i + 1 < velocity.size(); ++i) {
    if (changes(i) > changes(worst)) worst = i;
  }
  const double change = changes(worst);
  if (!(change > limits.velocity_change * usual)) return;
  const auto at = std::find_if(result.quality.begin(), result.quality.end(),
                               [&](const tracking::FrameQuality& q) { return q.time_s == poses[worst + 1].time_s; });
  warnings.push_back(
      {"the camera jumps: its velocity changes by " + base::formatted("%.2g", usual > 0 ? change / usual : 0.0) +
           " times its usual speed from one frame to the next",
       at == result.quality.end() ? kWhere : std::string(kWhere) + ", " + frames_text(*at, *at, name_of),
       Severity::kWarning,
       "check the frames around it for an obstruction in front of the lens or missing frames; leave them out"});
}

/// Reports a systematic displacement of residuals: wrong lens, shutter, or false initialization.
void check_calibration(const OdometryResult& result, const WarningThresholds& limits, Warnings& warnings) {
  if (!result.systematic_displacement || result.systematic_displacement->rms_px <= limits.systematic_px ||
      result.systematic_displacement->sigmas <= limits.systematic_sigmas)
    return;
  warnings.push_back(
      {"the calibration does not fit the images: residuals have a systematic pattern of " +
           base::formatted("%.2g", result.systematic_displacement->rms_px) +
           " pixels (RMS) in all keyframes (wrong lens model or line delay, or a wrong initialization)",
       kWhere,
       result.systematic_displacement->rms_px > limits.systematic_likely_px ? Severity::kWarning : Severity::kNote,
       "calibrate the camera with the settings of the flight (focus, resolution, crop, rolling shutter)"});
}

/// Reports a focal length that changes in flight.
void check_focal_length(const OdometryResult& result, const FrameName& name_of, Warnings& warnings) {
  const auto shows_change = [](const FocalSegment& segment) { return segment.shows_change(); };
  const auto count = std::ranges::count_if(result.focal_segments, shows_change);
  if (count == 0) return;
  const auto change = [&](const FocalSegment& segment) {
    return shows_change(segment) ? std::abs(segment.most_changed().log_change) : 0.0;
  };
  const FocalSegment& most = *std::ranges::max_element(result.focal_segments, {}, change);
  const FocalSegment::Image& image = most.most_changed();
  constexpr double kKnown = 0.005;  // a factor with a larger sigma is not stated; chosen by hand
  const std::string factor =
      image.sigma < kKnown ? ", by a factor of " + base::formatted("%.3f", std::exp(image.log_change)) : "";
  warnings.push_back(
      {"the focal length changes in flight" + factor + " from frame " + name_of(most.images.front().frame) + " to " +
           name_of(image.frame) +
           " (a zoom, or stabilization that scales): with a focal length for each image the residuals there are " +
           base::formatted("%.2g", most.residual_px) + " instead of " +
           base::formatted("%.2g", most.one_focal_length_px) + " pixels; " + count_text(count) + " of " +
           count_text(std::ssize(result.focal_segments)) + " segments of the flight show a change",
       kWhere, Severity::kWarning, "use a part of the flight with one focal length (--from, --to; focal_length.csv)"});
}

void check_second_run(const OdometryResult& result, const std::optional<RunAgreement>& second, const FrameName& name_of,
                      const WarningThresholds& limits, Warnings& warnings) {
  if (!second || second->rms_share <= limits.disagreement) return;
  const auto at =
      std::min_element(result.quality.begin(), result.quality.end(),
                       [&](const tracking::FrameQuality& a, const tracking::FrameQuality& b) {
                         return std::abs(a.time_s - second->worst_time_s) < std::abs(b.time_s - second->worst_time_s);
                       });
  warnings.push_back(
      {"forward and backward tracking disagree: their paths differ by " + percent_text(second->rms_share) +
           " of their length (wrong initialization or scale drift)",
       at == result.quality.end() ? kWhere : std::string(kWhere) + ", most at " + frames_text(*at, *at, name_of),
       Severity::kWarning, "track parts of the flight separately (--from, --to) and compare them"});
}

/// Returns what a turn against the calibration does, as the end of a sentence; nullopt: nothing that matters.
std::optional<std::string> effect_of(const RigTurn& turn) {
  constexpr double kDegrees = 180.0 / std::numbers::pi;
  constexpr double kSigmas = 5.0, kLeastError = 0.01, kVisible_px = 0.5, kHalf = 0.5;  // chosen by hand
  const double along_rad = turn.along_parallax_rad(), sigma_rad = turn.along_parallax_sigma_rad();
  const double error = turn.distance_error();
  const bool changes_distances = std::abs(along_rad) > kSigmas * sigma_rad && std::abs(error) > kLeastError;
  const double largest_sigma_rad = std::sqrt(turn.covariance_rad2.diagonal().maxCoeff());
  const bool moves_corners = turn.turn_rad.norm() > std::max(kVisible_px * turn.pixel_rad, kSigmas * largest_sigma_rad);
  if (!changes_distances && !moves_corners) return std::nullopt;
  const geometry::Vec3 degrees = kDegrees * turn.turn_rad;
  std::string text = base::formatted(" (%.3f, %.3f and %.3f about the axes right, down and forward, each to %.3f)",
                                     degrees.x(), degrees.y(), degrees.z(), kDegrees * largest_sigma_rad);
  if (changes_distances)
    text += std::string(", so that the scale of the map is wrong: by the rig, half of the distances are too ") +
            (error > 0.0 ? "large" : "small") +
            (std::abs(error) < kHalf ? " by more than " + percent_text(std::abs(error)) : " by more than half");
  return text;
}

/// Reports what contradicts the calibration of a rig's camera.
void check_rig_fit(const OtherCameraResult& camera, const WarningThresholds& limits, Warnings& warnings) {
  constexpr double kDegrees = 180.0 / std::numbers::pi;
  const std::optional<std::string> effect = camera.turn ? effect_of(*camera.turn) : std::nullopt;
  if (camera.fit && camera.fit->behind_share > 0.5) {
    warnings.push_back({"camera " + camera.name +
                            " is on the other side of the reference camera than its calibration says: " +
                            percent_text(camera.fit->behind_share) +
                            " of what both see would be behind them (cameras or their poses exchanged)",
                        kWhere, Severity::kWarning, "exchange the two cameras, or correct T_cn_cnm1 (T_body_cam)"});
  } else if (effect || (camera.fit && camera.fit->rotation_rad > limits.rig_rotation_rad)) {
    const double turned_rad = effect ? camera.turn->turn_rad.norm() : camera.fit->rotation_rad;
    warnings.push_back({"camera " + camera.name + " is not where its calibration says: it is turned by about " +
                            base::formatted("%.2g", kDegrees * turned_rad) + " degrees against it" +
                            effect.value_or(""),
                        kWhere, Severity::kWarning, "calibrate the rig again (T_cn_cnm1, T_body_cam)"});
  }
}

/// Reports where a rig's camera was of no use.
void check_other_images(const OtherCameraResult& camera, const OdometryResult& result, const FrameName& name_of,
                        const WarningThresholds& limits, Warnings& warnings) {
  constexpr int kFewKeyframes = 3;
  constexpr std::int64_t kFewFrames = 5;
  const std::string what = "camera " + camera.name;
  if (camera.frames_blind > 0) {
    warnings.push_back({what + " shows nothing in " + count_text(camera.frames_blind) + " of " +
                            count_text(camera.frames) + " images: there the map rests on the other cameras alone",
                        kWhere, Severity::kError, "uncover or repair the camera"});
  }
  if (camera.keyframes_unmatched >= kFewKeyframes &&
      camera.keyframes_unmatched > limits.unmatched_share * camera.keyframes) {
    warnings.push_back({"nothing matches between " + what + " and the reference camera in " +
                            count_text(camera.keyframes_unmatched) + " of " + count_text(camera.keyframes) +
                            " keyframes",
                        kWhere, Severity::kWarning, "check the rig's calibration, and that the camera is not covered"});
  }
  const std::int64_t usual = camera.frames > 0 ? result.frames / camera.frames : 0;
  if (camera.frames_after_last > std::max(kFewFrames, 3 * usual)) {
    const std::string side = result.backwards ? "first" : "last";
    const std::string last =
        camera.last_frame < 0 ? "it has none" : "its " + side + " is at frame " + name_of(camera.last_frame);
    warnings.push_back({what + " has no image in the " + side + " " + count_text(camera.frames_after_last) +
                            " frames (" + last + "): there the map rests on the other cameras alone",
                        kWhere, Severity::kError,
                        result.backwards ? "look for what it waited for; use the part after (--from)"
                                         : "look for what stopped it; use the part before (--to)"});
  }
}

void check_stereo(const OdometryResult& result, const FrameName& name_of, const WarningThresholds& limits,
                  Warnings& warnings) {
  if (!result.stereo) return;
  if (!result.stereo->metric) {
    const bool by_readings = result.inertial && result.inertial->metric;
    const std::string what = by_readings ? "the rig gave the map no scale, the inertial unit did: when it began, the "
                                           "rig's other cameras showed no distances"
                                         : "the map has no metric scale: when it began, the rig's other cameras showed "
                                           "no distances, and it is that of the reference camera alone";
    warnings.push_back({what, kWhere, Severity::kError, "check the other cameras' images and the rig's calibration"});
  }
  for (const OtherCameraResult& camera : result.stereo->cameras) {
    check_rig_fit(camera, limits, warnings);
    check_other_images(camera, result, name_of, limits, warnings);
  }
}

}  // namespace

Warnings find_warnings(const OdometryResult& result, std::int64_t frames, const FrameName& name_of,
                       const std::optional<RunAgreement>& second, const WarningThresholds& limits) {
  Warnings warnings;
  check_completeness(result, frames, limits, warnings);
  if (result.frames_tracked == 0) return warnings;
  check_length(result, limits, warnings);
  check_stereo(result, name_of, limits, warnings);
  check_metric_scale(result, limits, warnings);
  const Warnings path = find_path_warnings(result, name_of, second, limits);
  warnings.insert(warnings.end(), path.begin(), path.end());
  check_residuals(result, name_of, limits, warnings);
  check_jumps(result, name_of, limits, warnings);
  check_calibration(result, limits, warnings);
  check_focal_length(result, name_of, warnings);
  return warnings;
}

Warnings find_path_warnings(const OdometryResult& result, const FrameName& name_of,
                            const std::optional<RunAgreement>& second, const WarningThresholds& limits) {
  Warnings warnings;
  check_second_run(result, second, name_of, limits, warnings);
  check_scale_drift(result, name_of, limits, warnings);
  return warnings;
}

namespace {

double median_rmse(const OdometryResult& result) {
  std::vector<double> rmse;
  for (const tracking::FrameQuality& q : result.quality) {
    if (q.tracked && q.rmse > 0.0) rmse.push_back(q.rmse);
  }
  if (rmse.empty()) return 0.0;
  std::nth_element(rmse.begin(), rmse.begin() + static_cast<std::ptrdiff_t>(rmse.size() / 2), rmse.end());
  return rmse[rmse.size() / 2];
}

/// Whether `a` has no warnings, `b` has, and the median residual of `a` is below this share of the other's.
bool is_better(const OdometryResult& a, const OdometryResult& b, double residual_share,
               const WarningThresholds& limits) {
  return median_rmse(a) < residual_share * median_rmse(b) && !has_own_warnings(a, limits) &&
         has_own_warnings(b, limits);
}

}  // namespace

Warnings focal_warnings(const imaging::Camera& given, const imaging::Camera& estimated, double focal_sigma) {
  constexpr double kSigmas = 1.5;
  const auto focal_px = [](const imaging::Camera& camera) {
    return std::visit([](const auto& model) { return model.fx; }, camera.model());
  };
  const double from = focal_px(given), to = focal_px(estimated), change = std::abs(to / from - 1.0);
  if (!(change > kSigmas * focal_sigma)) return {};
  return {{base::formatted("the focal length was estimated as %.0f pixels, %.1f %% from the calibration's %.0f; images "
                           "straight down over level ground hardly show it, and the heights of the map change with it",
                           to, 100.0 * change, from),
           kWhere, Severity::kWarning,
           "calibrate the lens, or keep a calibration that is right (`fixed_intrinsics`, --fixed-intrinsics)"}};
}

bool has_own_warnings(const OdometryResult& result, const WarningThresholds& limits) {
  const auto no_name = [](std::int64_t) { return std::string(); };
  return !find_warnings(result, result.frames, no_name, {}, limits).empty();
}

RunChoice choose_run(const OdometryResult& first, const OdometryResult& second,
                     const std::optional<RunAgreement>& agreement, const WarningThresholds& limits) {
  // Shares of the other run's poses. Chosen by hand.
  constexpr double kFarFewer = 0.8, kAsMany = 0.95;
  constexpr double kClearly = 0.9, kRather = 1.1;  // of the other's median residual; chosen by hand
  const auto poses = [](const OdometryResult& result) { return static_cast<double>(result.frames_tracked); };
  if (poses(first) < kFarFewer * poses(second)) return RunChoice::kSecond;
  if (poses(second) < kAsMany * poses(first)) return RunChoice::kFirst;
  if (!agreement || agreement->rms_share <= limits.disagreement) return RunChoice::kFirst;
  if (is_better(first, second, kClearly, limits)) return RunChoice::kFirst;
  if (is_better(second, first, kClearly, limits)) return RunChoice::kSecond;
  return is_better(second, first, kRather, limits) ? RunChoice::kRatherSecond : RunChoice::kOpen;
}

}  // namespace tileflight::odometry
