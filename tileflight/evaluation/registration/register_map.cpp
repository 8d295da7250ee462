#include "tileflight/evaluation/registration/register_map.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "tileflight/core/alignment/similarity_chart.h"
#include "tileflight/core/alignment/uncertainty.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/evaluation/registration/recognized_places.h"
#include "tileflight/evaluation/registration/registration_warnings.h"
#include "tileflight/evaluation/registration/start_refiner.h"

namespace tileflight::registration {

using geometry::Sim3;
using geometry::Vec3;
using geometry::Vec7;

namespace {

// ---- starts ----

/// Rotates a start about an axis through the path's centre.
Sim3 rotate_about(const Sim3& T, const Vec3& axis, double angle_rad, const Vec3& middle) {
  Vec7 motion = Vec7::Zero();
  motion.segment<3>(3) = angle_rad * axis;
  return apply_motion(T, motion, middle);
}

/// RMS sine of the tilt of the camera's x axes; a camera on an upright vehicle does not roll.
double rms_tilt(const geometry::Trajectory& path, const Sim3& T) {
  double sum = 0.0;
  for (const auto& pose : path.poses)
    sum += std::pow((T.rotation * (pose.T_local_camera.rotation * Vec3::UnitX())).z(), 2);
  return std::sqrt(sum / static_cast<double>(std::max<std::size_t>(1, path.size())));
}

/// Whether the image tops point up rather than down, most of the time.
bool is_upright(const geometry::Trajectory& path, const Sim3& T) {
  double up = 0.0;
  for (const auto& pose : path.poses) up -= (T.rotation * (pose.T_local_camera.rotation * Vec3::UnitY())).z();
  return up >= 0.0;
}

/// Penalty of a rotation, by how level and upright the camera is under it. (With known gravity only rotations about the
/// vertical are open, and all have the same penalty.)
double attitude_penalty(const RegistrationEvidence& evidence, const Sim3& T) {
  return rms_tilt(evidence.path, T) + (is_upright(evidence.path, T) ? 0.0 : 1.0);
}

/// Starts for a rotation that positions do not determine (about a straight path): every ten degrees, most likely first.
std::vector<Start> rotated_starts(const Start& start, const TelemetryEstimate& telemetry,
                                  const RegistrationEvidence& evidence) {
  constexpr int kTurns = 36;
  std::vector<std::pair<double, Start>> turns;
  for (int k = 0; k < kTurns; ++k) {
    Start other = start;
    other.T = rotate_about(start.T, telemetry.worst_axis_local, 2.0 * std::numbers::pi * k / kTurns,
                           telemetry.estimate.center);
    other.known->T_target_source = other.T;
    turns.emplace_back(attitude_penalty(evidence, other.T), other);
  }
  std::ranges::stable_sort(turns, {}, [](const auto& turn) { return turn.first; });
  std::vector<Start> starts;
  for (auto& [order, turn] : turns) starts.push_back(std::move(turn));
  return starts;
}

std::vector<Start> given_starts(const RegistrationEvidence& evidence) {
  std::vector<Start> starts;
  for (const Sim3& T : evidence.starts) starts.push_back({T, "given"});
  return starts;
}

/// Starts from a receiver's positions, with or without a gimbal's attitude or gravity.
std::vector<Start> starts_from_telemetry(const RegistrationEvidence& evidence,
                                         const alignment::TrajectoryAlignment& fit,
                                         const std::optional<RotationEstimate>& rotation, const std::string& name) {
  const TelemetryEstimate telemetry = estimate_from_telemetry(evidence.path, evidence.positions, fit, rotation);
  const Start start{telemetry.estimate.T_target_source, name, telemetry.estimate};
  constexpr double kOpen_rad = 0.15;
  if (telemetry.worst_rotation_sigma_rad < kOpen_rad) return {start};
  return rotated_starts(start, telemetry, evidence);
}

// ---- selection ----

/// The starts with the best ray agreement, before any refinement.
std::vector<Start> preselect_starts(std::vector<Start> starts, const StartRefiner& follower, std::size_t most) {
  if (starts.size() <= most) return starts;
  std::vector<std::pair<double, std::size_t>> order;
  for (std::size_t k = 0; k < starts.size(); ++k) {
    const auto rays = follower.rays(starts[k].T);
    constexpr double kRankWeight = 0.01;  // breaks ties by the order of the starts
    order.emplace_back((rays ? -rays->score : 0.0) + kRankWeight * static_cast<double>(k), k);
  }
  std::ranges::sort(order);
  std::vector<Start> chosen;
  for (std::size_t k = 0; k < most; ++k) chosen.push_back(starts[order[k].second]);
  return chosen;
}

/// Which candidates' images are compared.
enum class Compared {
  kUntilRecognized,  ///< until the images of one are recognised: all lie near a place that is known
  kAll               ///< of all: places that were found may look alike
};

/// Refines the starts and compares their images; appends the candidates, best first.
void refine_all(const std::vector<Start>& starts, const StartRefiner& follower, const RegistrationOptions& options,
                Compared compared, std::vector<Candidate>& candidates, RegistrationResult& result) {
  std::vector<Candidate> here;
  for (const Start& start : starts) {
    here.push_back(follower.refine(start));
    ++result.starts_tried;
  }
  std::ranges::stable_sort(here, is_better);
  for (Candidate& candidate : here) {
    candidate.pictures = follower.check_pictures(candidate.T, options.coarse_pictures);
    if (candidate.is_recognised() && compared == Compared::kUntilRecognized) break;
    if (!candidate.is_recognised()) candidate.T = candidate.fit.T_target_source;
  }
  candidates.insert(candidates.end(), here.begin(), here.end());
  std::ranges::stable_sort(candidates, is_better);
}

/// Whether the search for further places can stop.
bool is_convincing(const Candidate& candidate) {
  constexpr double kRays = 0.55;
  return candidate.is_recognised() || (!candidate.pictures && candidate.start.known && candidate.ray_score() > kRays);
}

/// Jackknife over groups of points from consecutive keyframes.
double shape_sigma_m(const ObservedPoints& points, const GroundTruthSurface& surface, const SurfaceFitOptions& options,
                     const Sim3& T, const alignment::PointSpread& spread) {
  constexpr std::size_t kGroups = 6, kPoints = 12000;
  const ObservedPoints few = subsample(points, kPoints);
  std::size_t keyframes = few.size();  // without keyframes: groups of points in their order
  if (!few.keyframe.empty()) keyframes = 1 + *std::ranges::max_element(few.keyframe);
  const std::size_t groups = std::min(kGroups, keyframes);
  return alignment::jackknife_sigma_m(T, groups, spread, [&](std::size_t group) {
    ObservedPoints selected;
    for (std::size_t i = 0; i < few.size(); ++i) {
      const std::size_t key = few.keyframe.empty() ? i : few.keyframe[i];
      if (key * groups / keyframes == group) continue;
      selected.positions.push_back(few.positions[i]);
      if (few.has_viewpoints()) selected.viewpoints.push_back(few.viewpoints[i]);
      if (!few.distance_sigma.empty()) selected.distance_sigma.push_back(few.distance_sigma[i]);
      if (!few.keyframe.empty()) selected.keyframe.push_back(few.keyframe[i]);
    }
    if (selected.positions.empty()) return T;
    return fit_to_surface(selected, surface.index, surface.mesh, T, options).T_target_source;
  });
}

/// The steps of register_map(), with their shared state.
class MapRegistrar {
 public:
  MapRegistrar(const ObservedPoints& points, const RegistrationEvidence& evidence, const GroundTruthSurface& surface,
               const RegistrationServices& services, const RegistrationOptions& options)
      : points_(points),
        evidence_(evidence),
        surface_(surface),
        services_(services),
        options_(options),
        refiner_(points, evidence, surface, services, options),
        spread_(alignment::compute_spread(refiner_.coarse_points().positions)) {}

  RegistrationResult run(const Progress& progress) {
    constexpr std::int64_t kSteps = 4;
    const auto report = [&](std::int64_t step) { report_progress(progress, step, kSteps, "aligning the map"); };
    report(0);
    try_starts(given_starts(evidence_));
    try_telemetry();
    report(1);
    try_places();
    report(2);
    Candidate best = chosen();
    finish(best);
    report(3);
    add_registration_warnings(points_, evidence_, result_);
    report(kSteps);
    return std::move(result_);
  }

 private:
  bool is_settled() const { return !candidates_.empty() && is_convincing(candidates_.front()); }

  void try_starts(const std::vector<Start>& starts, Compared compared = Compared::kUntilRecognized) {
    constexpr std::size_t kMostTurns = 8;
    refine_all(preselect_starts(starts, refiner_, kMostTurns), refiner_, options_, compared, candidates_, result_);
  }

  void try_telemetry() {
    if (evidence_.positions.empty() || evidence_.path.empty()) return;
    result_.telemetry = alignment::align_trajectory(evidence_.path, evidence_.positions, options_.trajectory);
    const auto follow_from = [&](const std::optional<RotationEstimate>& rotation, const std::string& name) {
      if (!is_settled()) try_starts(starts_from_telemetry(evidence_, *result_.telemetry, rotation, name));
    };
    if (const auto rotation = rotation_from_attitudes(evidence_.path, evidence_.attitudes))
      follow_from(rotation, "positions and attitude");
    if (evidence_.up) follow_from(upright_rotation(*evidence_.up), "positions and gravity");
    follow_from(std::nullopt, "positions");
  }

  void try_places() {
    for (const auto& look : {services_.find_places_by_appearance, services_.find_places_by_shape}) {
      if (is_settled() || !look) continue;
      std::vector<Start> places;
      for (const Sim3& T : look()) places.push_back({T, kSearchedStart});
      if (!accept_recognized_places(places)) try_starts(places, Compared::kAll);
    }
  }

  /// Accepts places where the images are recognised at once, so that no place needs to be refined by shape before one
  /// is chosen.
  bool accept_recognized_places(const std::vector<Start>& places) {
    std::vector<Candidate> recognized;
    for (const Start& place : places) {
      Candidate candidate{.start = place, .T = place.T};
      candidate.pictures = refiner_.check_pictures(candidate.T, options_.coarse_pictures);
      if (candidate.is_recognised()) recognized.push_back(std::move(candidate));
    }
    if (recognized.empty()) return false;
    std::ranges::stable_sort(recognized, is_better);
    candidates_.insert(candidates_.begin(), recognized.begin(), recognized.end());
    ++result_.starts_tried;
    return true;
  }

  /// Whether a scale differs from the telemetry's by more than its uncertainty and by more than odometry's drift.
  bool contradicts_telemetry(double scale) const {
    const SimilarityEstimate known =
        estimate_from_telemetry(evidence_.path, evidence_.positions, *result_.telemetry, std::nullopt).estimate;
    const double information = known.information(6, 6);
    constexpr double kSigmas = 5.0, kLeastRatio = 1.5;
    const double sigma = information > 0.0 ? 1.0 / std::sqrt(information) : 1.0;
    const double log_ratio = std::abs(std::log(scale / result_.telemetry->T_local_map.scale));
    return !(log_ratio <= std::max(std::log(kLeastRatio), kSigmas * sigma));
  }

  /// A map that shrank onto a spot of the surface, its cameras with it, agrees with all that it sees there. The
  /// telemetry's scale tells, so candidates that contradict it come last, unless images confirm them.
  void put_contradicted_scales_last() {
    if (!result_.telemetry) return;
    std::stable_partition(candidates_.begin(), candidates_.end(),
                          [&](const Candidate& c) { return c.is_recognised() || !contradicts_telemetry(c.T.scale); });
  }

  /// Whether the telemetry's positions are elsewhere, by more than a receiver's error.
  bool contradicts_positions(const Candidate& candidate) const {
    if (!result_.telemetry) return false;
    constexpr double kSigmas = 5.0, kLeast_m = 3.0;
    double sigma_m = 0.0;
    for (const alignment::PositionFix& fix : evidence_.positions) sigma_m = std::max(sigma_m, fix.horizontal_sigma_m);
    const Vec3 apart =
        distance_to_fixes(evidence_.path, evidence_.positions, candidate.T, result_.telemetry->time_offset_s);
    return apart.head<2>().norm() > std::max(kLeast_m, kSigmas * sigma_m);
  }

  /// Chooses among the places that were found without a start: the one that fits the images best. Records another one
  /// that fits as well.
  void compare_similar_places() {
    if (candidates_.front().start.name != kSearchedStart || !candidates_.front().is_recognised()) return;
    const auto contradicted = std::stable_partition(candidates_.begin(), candidates_.end(), [&](const Candidate& c) {
      return c.is_recognised() && !contradicts_positions(c);
    });
    std::vector<Candidate> compared(candidates_.begin(), contradicted);
    if (compared.empty()) compared = candidates_;
    result_.similar_place_distance_m = find_similar_place(compared, refiner_, options_.fine_pictures, spread_);
    candidates_.insert(candidates_.begin(), compared.front());
    Candidate& best = candidates_.front();
    const Candidate refined = refiner_.refine({best.T, best.start.name});
    best.fit = refined.fit;
    best.rays = refined.rays;
  }

  /// The best candidate; also records the best of the others.
  Candidate chosen() {
    put_contradicted_scales_last();
    if (candidates_.empty()) {
      throw InputError("alignment",
                       "the map's position is unknown, and no position was found where it resembles the ground truth; "
                       "give positions (gps.csv), a start, or a larger region");
    }
    compare_similar_places();
    const Candidate& best = candidates_.front();
    const double same_m = same_place_m(best.T, spread_);
    for (std::size_t k = 1; k < candidates_.size() && !result_.runner_up_distance_m; ++k) {
      const double apart_m = alignment::rms_motion_m(best.T, candidates_[k].T, spread_);
      if (apart_m < same_m) continue;
      result_.runner_up_distance_m = apart_m;
      result_.runner_up_score = candidates_[k].ray_score();
    }
    return best;
  }

  /// Final fit: by the images if they are recognised, else by the surface; the surface fit is computed in any case.
  void finish(Candidate& best) {
    Sim3 T = best.T;
    constexpr double kWeak = 0.03;  // of Constraint::eigenvalues
    const bool weak = best.fit.constraint.eigenvalues.empty() || best.fit.constraint.eigenvalues.front() < kWeak;
    if (best.is_recognised() && weak) result_.repetition_distance_m = find_repetition(refiner_, spread_, T);
    if (best.is_recognised()) best.pictures = refiner_.check_pictures(T, options_.fine_pictures, PictureDetail::kFine);
    const bool by_pictures = best.is_recognised() && options_.regions.empty();
    const ObservedPoints many = subsample(points_, options_.fine_points);
    SurfaceFitOptions fit = refiner_.fit_options(best.start, {1.0, 0.5});
    if (!options_.regions.empty()) fit.regions = options_.regions;
    if (best.is_recognised()) fit.prior.reset();
    result_.surface = fit_to_surface(many, surface_.index, surface_.mesh, T, fit);
    if (by_pictures) {
      const auto& estimate = best.pictures->estimate;
      result_.sigma_m = estimate ? sigma_of(*estimate) : std::numeric_limits<double>::quiet_NaN();
    } else {
      fit.radii_m = {0.5};
      result_.sigma_m = shape_sigma_m(many, surface_, fit, result_.surface.T_target_source, spread_);
    }
    result_.start = best.start.name;
    result_.method = by_pictures ? "pictures" : "surface";
    result_.T_local_map = by_pictures ? T : result_.surface.T_target_source;
    result_.pictures = best.pictures;
    result_.rays = refiner_.rays(result_.T_local_map);
    result_.moved_from_start_m = alignment::rms_motion_m(best.start.T, result_.T_local_map, spread_);
  }

  double sigma_of(const SimilarityEstimate& estimate) const {
    return motion_sigma_m(estimate.information.inverse(), estimate.T_target_source, estimate.center, spread_);
  }

  const ObservedPoints& points_;
  const RegistrationEvidence& evidence_;
  const GroundTruthSurface& surface_;
  const RegistrationServices& services_;
  const RegistrationOptions& options_;
  StartRefiner refiner_;
  alignment::PointSpread spread_;
  std::vector<Candidate> candidates_;  ///< best first
  RegistrationResult result_;
};

}  // namespace

RegistrationResult register_map(const ObservedPoints& points, const RegistrationEvidence& evidence,
                                const GroundTruthSurface& surface, const RegistrationServices& services,
                                const RegistrationOptions& options, const Progress& progress) {
  if (points.positions.empty()) throw InputError("map", "has no points; there is nothing to align");
  return MapRegistrar(points, evidence, surface, services, options).run(progress);
}

}  // namespace tileflight::registration
