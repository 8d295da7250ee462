#include "tileflight/registration/register_map.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "tileflight/alignment/jackknife.h"
#include "tileflight/alignment/similarity_chart.h"
#include "tileflight/base/input_error.h"
#include "tileflight/registration/located_poses_sigma.h"
#include "tileflight/registration/registration_doubts.h"

namespace tileflight::registration {

using geometry::Mat3;
using geometry::Sim3;
using geometry::Vec3;
using geometry::Vec7;

namespace {

/// A start of the registration.
struct Start {
  Sim3 T;
  std::string name;
  std::optional<SimilarityEstimate> known{};  ///< estimate from telemetry, near T
};

/// Result of refining a start, with its evidence.
struct Candidate {
  Start start;
  Sim3 T;
  SurfaceFit fit;
  std::optional<RayAgreement> rays;
  std::optional<PictureAgreement> pictures;

  bool is_recognised() const {
    return pictures && 2 * pictures->located >= pictures->tried && pictures->inliers >= 4 &&
           3 * pictures->inliers >= 2 * pictures->located;
  }
  double ray_score() const { return rays ? rays->score : fit.inlier_share; }
};

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

// ---- refining a start ----

class StartRefiner {
 public:
  StartRefiner(const ObservedPoints& points, const RegistrationEvidence& evidence, const GroundTruthSurface& surface,
               const RegistrationServices& services, const RegistrationOptions& options)
      : coarse_points_(subsample(points, options.coarse_points)),
        evidence_(evidence),
        surface_(surface),
        services_(services),
        options_(options) {}

  SurfaceFitOptions fit_options(const Start& start, std::vector<double> radii_m) const {
    SurfaceFitOptions fit;
    fit.radii_m = std::move(radii_m);
    fit.max_scale_change = options_.max_scale_change;
    fit.scale_center = start.T.scale;
    fit.scale = options_.scale;
    fit.regions = surface_.regions;
    fit.prior = start.known;
    return fit;
  }

  std::optional<RayAgreement> rays(const Sim3& T) const {
    if (!services_.cast_ray) return std::nullopt;
    return compute_ray_agreement(coarse_points_, T, services_.cast_ray, {.regions = surface_.regions});
  }

  Candidate refine(const Start& start) const {
    Candidate candidate{.start = start, .T = start.T};
    candidate.fit = fit_to_surface(coarse_points_, surface_.index, surface_.mesh, start.T,
                                   fit_options(start, options_.coarse_radii_m));
    candidate.T = candidate.fit.T_target_source;
    candidate.rays = rays(candidate.T);
    return candidate;
  }

  /// Agreement of the images with `T`, which is moved to the fit of the located poses. `sigma_m`: its uncertainty.
  std::optional<PictureAgreement> check_pictures(Sim3& T, std::size_t pictures,
                                                 PictureDetail detail = PictureDetail::kCoarse,
                                                 double* sigma_m = nullptr) const;

  /// Subsampled map points for comparing starts.
  const ObservedPoints& coarse_points() const { return coarse_points_; }
  /// Median distance of the points from their viewpoints, metres; 0 if unknown.
  double viewing_distance_m(const Sim3& T) const;

 private:
  ObservedPoints coarse_points_;
  const RegistrationEvidence& evidence_;
  const GroundTruthSurface& surface_;
  const RegistrationServices& services_;
  const RegistrationOptions& options_;
};

std::vector<LocatedPose> extract_poses(const LocatedPictures& pictures) {
  std::vector<LocatedPose> poses;
  for (const LocatedPicture& picture : pictures.found) poses.push_back(picture.found);
  return poses;
}

std::vector<LocatedPose> select_poses(const std::vector<LocatedPose>& poses, const std::vector<bool>& selected) {
  std::vector<LocatedPose> some;
  for (std::size_t i = 0; i < poses.size(); ++i)
    if (selected[i]) some.push_back(poses[i]);
  return some;
}

double rms_position_error_m(const std::vector<LocatedPose>& poses, const Sim3& T, const std::vector<bool>& counted) {
  double sum = 0.0, n = 0.0;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    if (!counted[i]) continue;
    sum += (T * poses[i].T_map_camera.translation - poses[i].T_local_camera.translation).squaredNorm();
    n += 1.0;
  }
  return n > 0.0 ? std::sqrt(sum / n) : 0.0;
}

PictureAgreement picture_agreement(const LocatedPictures& pictures, const std::vector<bool>& agrees, const Sim3& T,
                                   const geometry::Trajectory& path) {
  const std::vector<LocatedPose> poses = extract_poses(pictures);
  PictureAgreement agreement{.tried = pictures.tried, .located = poses.size()};
  std::vector<Vec3> in_map, found;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    in_map.push_back(poses[i].T_map_camera.translation);
    found.push_back(poses[i].T_local_camera.translation);
    const double apart_m = (T * in_map.back() - found.back()).norm();
    if (apart_m > agreement.worst_m) {
      agreement.worst_m = apart_m;
      agreement.worst_time_s = path.poses[pictures.found[i].pose].time_s;
    }
    if (i > 0) agreement.path_length_m += (found[i] - found[i - 1]).norm();
    if (!agrees[i]) continue;
    ++agreement.inliers;
    agreement.correlation += pictures.found[i].correlation;
  }
  if (agreement.inliers > 0) agreement.correlation /= static_cast<double>(agreement.inliers);
  agreement.inlier_rms_m = rms_position_error_m(poses, T, agrees);
  if (poses.size() >= 3) {
    const Sim3 of_all = alignment::umeyama(in_map, found).T_target_source;
    agreement.path_error_m = rms_position_error_m(poses, of_all, std::vector<bool>(poses.size(), true));
  }
  return agreement;
}

/// Consecutive outliers that lie near the path are unlikely to be independent localization errors: the path itself is
/// slightly bent there, and the transform must fit all of it, so they become inliers again. Single outliers and more
/// distant ones stay out; the latter are reported as a doubt about the path.
std::vector<bool> readmit_bent_segments(const std::vector<LocatedPose>& poses, const LocatedPosesFit& fit) {
  double path_m = 0.0;
  for (std::size_t i = 1; i < poses.size(); ++i)
    path_m += (poses[i].T_local_camera.translation - poses[i - 1].T_local_camera.translation).norm();
  const double near_m = std::max(kMinSegmentError_m, kSegmentErrorShare * path_m);
  const auto bends = [&](std::size_t i) { return !fit.is_inlier[i] && fit.distances_m[i] < near_m; };
  std::vector<bool> used = fit.is_inlier;
  for (std::size_t i = 0; i < used.size(); ++i) {
    const bool beside = (i > 0 && bends(i - 1)) || (i + 1 < used.size() && bends(i + 1));
    if (bends(i) && beside) used[i] = true;
  }
  return used;
}

std::optional<PictureAgreement> StartRefiner::check_pictures(Sim3& T, std::size_t pictures, PictureDetail detail,
                                                             double* sigma_m) const {
  if (!services_.locate_pictures) return std::nullopt;
  constexpr int kRounds = 2;  // the first round improves the initial poses of the second
  std::optional<PictureAgreement> agreement;
  for (int round = 0; round < kRounds; ++round) {
    const LocatedPictures located = services_.locate_pictures(T, pictures, detail);
    const std::vector<LocatedPose> poses = extract_poses(located);
    constexpr std::size_t kFewest = 3;
    if (poses.size() < kFewest) return PictureAgreement{.tried = located.tried, .located = poses.size()};
    const LocatedPosesFit fit = fit_located_poses(poses, T);
    if (fit.inliers < kFewest) return picture_agreement(located, fit.is_inlier, T, evidence_.path);
    const std::vector<bool> used = detail == PictureDetail::kFine ? readmit_bent_segments(poses, fit) : fit.is_inlier;
    const std::vector<LocatedPose> inliers = select_poses(poses, used);
    const Sim3 carried = similarity_of(inliers);
    agreement = picture_agreement(located, fit.is_inlier, carried, evidence_.path);
    T = carried;
    if (sigma_m != nullptr) {
      const PathCoverage coverage =
          10 * inliers.size() >= 9 * located.tried ? PathCoverage::kWhole : PathCoverage::kParts;
      *sigma_m = similarity_sigma_m(inliers, alignment::compute_spread(coarse_points_.positions), coverage);
    }
    if (agreement->located == agreement->tried) break;
  }
  return agreement;
}

double StartRefiner::viewing_distance_m(const Sim3& T) const {
  if (!coarse_points_.has_viewpoints()) return 0.0;
  std::vector<double> distances;
  for (std::size_t i = 0; i < coarse_points_.size(); ++i)
    distances.push_back((coarse_points_.positions[i] - coarse_points_.viewpoints[i]).norm());
  const auto half = distances.begin() + static_cast<std::ptrdiff_t>(distances.size() / 2);
  std::nth_element(distances.begin(), half, distances.end());
  return T.scale * *half;
}

// ---- selection ----

/// Order of candidates: recognised by images first, then by ray agreement.
bool is_better(const Candidate& a, const Candidate& b) {
  if (a.is_recognised() != b.is_recognised()) return a.is_recognised();
  return a.ray_score() > b.ray_score();
}

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

/// Refines the starts until one is clearly recognised; appends the candidates, best first.
void refine_all(const std::vector<Start>& starts, const StartRefiner& follower, const RegistrationOptions& options,
                std::vector<Candidate>& candidates, RegistrationResult& result) {
  std::vector<Candidate> here;
  for (const Start& start : starts) {
    here.push_back(follower.refine(start));
    ++result.starts_tried;
  }
  std::ranges::stable_sort(here, is_better);
  for (Candidate& candidate : here) {
    candidate.pictures = follower.check_pictures(candidate.T, options.coarse_pictures);
    if (candidate.is_recognised()) break;
    candidate.T = candidate.fit.T_target_source;
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

/// Textures may repeat (floor tiles, modelled places): over ground whose shape does not constrain the map, the images
/// may fit at a shifted place as well, or better. Tests shifted placements and moves `T` to a better one. Returns the
/// distance of a placement that fits equally well, if any.
std::optional<double> find_repetition(const StartRefiner& follower, const alignment::PointSpread& spread, Sim3& T) {
  constexpr std::size_t kPictures = 4;
  constexpr int kDirections = 8;
  constexpr double kBetter = 0.02, kEqual = 0.01, kLeastApart_m = 0.05;
  constexpr double kResolved = 0.01;  // share of the viewing distance, a few pixels; shorter repetitions are not
                                      // detected
  const auto here = follower.check_pictures(T, kPictures);
  if (!here) return std::nullopt;
  const double least_apart_m = std::max(kLeastApart_m, kResolved * follower.viewing_distance_m(T));
  double best = here->correlation;
  std::vector<std::pair<double, Sim3>> ends;
  for (const double share : {0.02, 0.04, 0.08}) {  // shifts, as shares of the viewing distance
    for (int k = 0; k < kDirections; ++k) {
      const double angle = 2.0 * std::numbers::pi * k / kDirections;
      const double step_m = share * follower.viewing_distance_m(T);
      Sim3 aside = T;
      aside.translation += step_m * Vec3(std::cos(angle), std::sin(angle), 0.0);
      const auto there = follower.check_pictures(aside, kPictures);
      if (there && there->inliers == there->tried) ends.emplace_back(there->correlation, aside);
    }
  }
  const Sim3 begun = T;
  for (const auto& [correlation, end] : ends) {
    if (correlation > best + kBetter || (T.matrix() != begun.matrix() && correlation > best))
      best = correlation, T = end;
  }
  // Coarse images converge to slightly different poses anyway, so a possible other placement is checked at full
  // accuracy.
  Sim3 here_closely = T;
  std::optional<PictureAgreement> best_closely;
  for (const auto& [correlation, end] : ends) {
    if (alignment::rms_motion_m(T, end, spread) < least_apart_m || correlation < best - kEqual) continue;
    if (!best_closely) best_closely = follower.check_pictures(here_closely, kPictures, PictureDetail::kFine);
    Sim3 end_closely = end;
    const auto there = follower.check_pictures(end_closely, kPictures, PictureDetail::kFine);
    if (!best_closely || !there || there->inliers < there->tried) continue;
    const double apart_m = alignment::rms_motion_m(here_closely, end_closely, spread);
    if (apart_m > least_apart_m && there->correlation > best_closely->correlation - kEqual) return apart_m;
  }
  return std::nullopt;
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
    add_registration_doubts(points_, evidence_, result_);
    report(kSteps);
    return std::move(result_);
  }

 private:
  bool is_settled() const { return !candidates_.empty() && is_convincing(candidates_.front()); }

  void try_starts(const std::vector<Start>& starts) {
    constexpr std::size_t kMostTurns = 8;
    refine_all(preselect_starts(starts, refiner_, kMostTurns), refiner_, options_, candidates_, result_);
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
      for (const Sim3& T : look()) places.push_back({T, "places"});
      if (!accept_recognized_place(places)) try_starts(places);
    }
  }

  /// Accepts a place found by appearance if the images confirm it, so that the other places need no refinement by
  /// shape.
  bool accept_recognized_place(const std::vector<Start>& places) {
    for (const Start& place : places) {
      Candidate candidate{.start = place, .T = place.T};
      candidate.pictures = refiner_.check_pictures(candidate.T, options_.coarse_pictures);
      if (!candidate.is_recognised()) continue;
      const Sim3 T = candidate.T;
      const std::optional<PictureAgreement> pictures = candidate.pictures;
      candidate = refiner_.refine({T, place.name});
      candidate.start = place;
      candidate.T = T;
      candidate.pictures = pictures;
      candidates_.insert(candidates_.begin(), std::move(candidate));
      ++result_.starts_tried;
      return true;
    }
    return false;
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
    std::stable_partition(candidates_.begin(), candidates_.end(), [&](const Candidate& c) {
      return c.is_recognised() || !contradicts_telemetry(c.T.scale);
    });
  }

  /// The best candidate; also records the best of the others.
  Candidate chosen() {
    put_contradicted_scales_last();
    if (candidates_.empty()) {
      throw InputError("alignment",
                       "the map's position is unknown, and no position was found where it resembles the ground truth; "
                       "give positions (gps.csv), a start, or a larger region");
    }
    const Candidate& best = candidates_.front();
    const Mat3 about_mean = spread_.second_moment - spread_.mean * spread_.mean.transpose();
    constexpr double kSame = 0.02, kSame_m = 0.5;  // of the map's size, and at least kSame_m
    const double same_m = std::max(kSame_m, kSame * best.T.scale * std::sqrt(about_mean.trace()));
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
    if (best.is_recognised())
      best.pictures = refiner_.check_pictures(T, options_.fine_pictures, PictureDetail::kFine, &result_.sigma_m);
    const bool by_pictures = best.is_recognised() && options_.regions.empty();
    const ObservedPoints many = subsample(points_, options_.fine_points);
    SurfaceFitOptions fit = refiner_.fit_options(best.start, {1.0, 0.5});
    if (!options_.regions.empty()) fit.regions = options_.regions;
    if (best.is_recognised()) fit.prior.reset();
    result_.surface = fit_to_surface(many, surface_.index, surface_.mesh, T, fit);
    if (!by_pictures) {
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
