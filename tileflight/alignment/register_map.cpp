#include "tileflight/alignment/register_map.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "tileflight/alignment/jackknife.h"
#include "tileflight/alignment/pose_alignment.h"
#include "tileflight/alignment/registration_doubts.h"
#include "tileflight/alignment/similarity_chart.h"
#include "tileflight/geometry/input_error.h"

namespace tileflight::alignment {

using geometry::Mat3;
using geometry::Sim3;
using geometry::Vec3;
using geometry::Vec7;

namespace {

/// Where a registration may begin.
struct Start {
  Sim3 T;
  std::string name;
  std::optional<SimilarityEstimate> known{};  ///< telemetry's, near T
};

/// Where a start led, and what speaks for it.
struct Candidate {
  Start start;
  Sim3 T;
  SurfaceFit fit;
  std::optional<RayAgreement> rays;
  std::optional<PictureAgreement> pictures;

  bool is_recognised() const {
    return pictures && 2 * pictures->located >= pictures->tried && pictures->agreeing >= 4 &&
           3 * pictures->agreeing >= 2 * pictures->located;
  }
  double ray_score() const { return rays ? rays->score : fit.agreeing; }
};

PointSpread spread_of(const ObservedPoints& points) {
  PointSpread spread;
  const auto n = static_cast<double>(points.size());
  for (const Vec3& p : points.positions) {
    spread.mean += p / n;
    spread.second_moment += p * p.transpose() / n;
  }
  return spread;
}

// ---- starts ----

/// The same start turned about an axis through the path's middle.
Sim3 turned(const Sim3& T, const Vec3& axis, double angle_rad, const Vec3& middle) {
  Vec7 motion = Vec7::Zero();
  motion.segment<3>(3) = angle_rad * axis;
  return moved_by(T, motion, middle);
}

/// How far from level the camera's x axes would be (root mean square of the sine): a camera that is carried upright
/// does not roll.
double unlevel(const geometry::Trajectory& path, const Sim3& T) {
  double sum = 0.0;
  for (const auto& pose : path.poses)
    sum += std::pow((T.rotation * (pose.T_local_camera.rotation * Vec3::UnitX())).z(), 2);
  return std::sqrt(sum / static_cast<double>(std::max<std::size_t>(1, path.size())));
}

/// Whether the pictures' tops look up rather than down, most of the time.
bool is_upright(const geometry::Trajectory& path, const Sim3& T) {
  double up = 0.0;
  for (const auto& pose : path.poses) up -= (T.rotation * (pose.T_local_camera.rotation * Vec3::UnitY())).z();
  return up >= 0.0;
}

/// How little a turn is to be expected: by how level and upright it carries the camera. (Gravity leaves such turns open
/// only about the vertical, where it does not tell them apart.)
double unlikely(const RegistrationEvidence& evidence, const Sim3& T) {
  return unlevel(evidence.path, T) + (is_upright(evidence.path, T) ? 0.0 : 1.0);
}

/// Where positions leave the turn about an axis open (a straight path), every ten degrees of it, the likelier first.
std::vector<Start> turns_about(const Start& start, const TelemetryEstimate& telemetry,
                               const RegistrationEvidence& evidence) {
  constexpr int kTurns = 36;
  std::vector<std::pair<double, Start>> turns;
  for (int k = 0; k < kTurns; ++k) {
    Start other = start;
    other.T =
        turned(start.T, telemetry.worst_axis_local, 2.0 * std::numbers::pi * k / kTurns, telemetry.estimate.center);
    other.known->T_target_source = other.T;
    turns.emplace_back(unlikely(evidence, other.T), other);
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

/// By a receiver's positions, with or without a gimbal's attitude or gravity.
std::vector<Start> starts_by_telemetry(const RegistrationEvidence& evidence, const TrajectoryAlignment& fit,
                                       const std::optional<RotationEstimate>& rotation, const std::string& name) {
  const TelemetryEstimate telemetry = estimate_of(evidence.path, evidence.positions, fit, rotation);
  const Start start{telemetry.estimate.T_target_source, name, telemetry.estimate};
  constexpr double kOpen_rad = 0.15;
  if (telemetry.worst_rotation_sigma_rad < kOpen_rad) return {start};
  return turns_about(start, telemetry, evidence);
}

// ---- following a start ----

class Follower {
 public:
  Follower(const ObservedPoints& points, const RegistrationEvidence& evidence, const Surface& surface,
           const RegistrationServices& services, const RegistrationOptions& options)
      : few_(thinned(points, options.coarse_points)),
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
    fit.known = start.known;
    return fit;
  }

  std::optional<RayAgreement> rays(const Sim3& T) const {
    if (!services_.cast) return std::nullopt;
    return ray_agreement(few_, T, services_.cast, {.regions = surface_.regions});
  }

  Candidate follow(const Start& start) const {
    Candidate candidate{.start = start, .T = start.T};
    candidate.fit =
        fit_to_surface(few_, surface_.index, surface_.mesh, start.T, fit_options(start, options_.coarse_radii_m));
    candidate.T = candidate.fit.T_target_source;
    candidate.rays = rays(candidate.T);
    return candidate;
  }

  /// What pictures say, and where they move the transform. `sigma_m`: how sure they are of it.
  std::optional<PictureAgreement> recognise(Sim3& T, std::size_t pictures,
                                            PictureDetail detail = PictureDetail::kCoarse,
                                            double* sigma_m = nullptr) const;

  /// The map's points, few enough to compare starts by.
  const ObservedPoints& few() const { return few_; }
  /// Median distance of the points from where they were seen, metres; 0 where that is not known.
  double viewing_distance_m(const Sim3& T) const;

 private:
  ObservedPoints few_;
  const RegistrationEvidence& evidence_;
  const Surface& surface_;
  const RegistrationServices& services_;
  const RegistrationOptions& options_;
};

std::vector<LocatedPose> poses_of(const LocatedPictures& pictures) {
  std::vector<LocatedPose> poses;
  for (const LocatedPicture& picture : pictures.found) poses.push_back(picture.found);
  return poses;
}

/// Best similarity of the agreeing poses: turns by their mean, place and scale by the positions (pose_alignment.h).
Sim3 carried_by(const std::vector<LocatedPose>& poses, const std::vector<bool>& agrees) {
  std::vector<geometry::SE3> in_map, found;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    if (!agrees[i]) continue;
    in_map.push_back(poses[i].T_map_camera);
    found.push_back(poses[i].T_local_camera);
  }
  return fit_poses(in_map, found);
}

double rms_apart_m(const std::vector<LocatedPose>& poses, const Sim3& T, const std::vector<bool>& counted) {
  double sum = 0.0, n = 0.0;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    if (!counted[i]) continue;
    sum += (T * poses[i].T_map_camera.translation - poses[i].T_local_camera.translation).squaredNorm();
    n += 1.0;
  }
  return n > 0.0 ? std::sqrt(sum / n) : 0.0;
}

PictureAgreement agreement_of(const LocatedPictures& pictures, const std::vector<bool>& agrees, const Sim3& T,
                              const geometry::Trajectory& path) {
  const std::vector<LocatedPose> poses = poses_of(pictures);
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
    if (i > 0) agreement.path_m += (found[i] - found[i - 1]).norm();
    if (!agrees[i]) continue;
    ++agreement.agreeing;
    agreement.correlation += pictures.found[i].correlation;
  }
  if (agreement.agreeing > 0) agreement.correlation /= static_cast<double>(agreement.agreeing);
  agreement.residual_m = rms_apart_m(poses, T, agrees);
  if (poses.size() >= 3) {
    const Sim3 of_all = umeyama(in_map, found).T_target_source;
    agreement.path_error_m = rms_apart_m(poses, of_all, std::vector<bool>(poses.size(), true));
  }
  return agreement;
}

/// Neighbours that disagree with the others together, but lie near, were hardly found wrongly one by one: the path
/// itself bends there, a little, and the transform has to carry all of it. Single ones and what is farther off stay
/// out: of the latter a doubt of the path is said.
std::vector<bool> with_bending_stretches(const std::vector<LocatedPose>& poses, const LocatedPosesFit& fit) {
  double path_m = 0.0;
  for (std::size_t i = 1; i < poses.size(); ++i)
    path_m += (poses[i].T_local_camera.translation - poses[i - 1].T_local_camera.translation).norm();
  const double near_m = std::max(kPartOffLeast_m, kPartOffShare * path_m);
  const auto bends = [&](std::size_t i) { return !fit.agrees[i] && fit.distances_m[i] < near_m; };
  std::vector<bool> used = fit.agrees;
  for (std::size_t i = 0; i < used.size(); ++i) {
    const bool beside = (i > 0 && bends(i - 1)) || (i + 1 < used.size() && bends(i + 1));
    if (bends(i) && beside) used[i] = true;
  }
  return used;
}

/// By leaving out stretches of the path.
double sigma_of_pictures_m(const std::vector<LocatedPose>& poses, const std::vector<bool>& agrees, const Sim3& T,
                           const PointSpread& points) {
  std::vector<LocatedPose> agreeing;
  for (std::size_t i = 0; i < poses.size(); ++i)
    if (agrees[i]) agreeing.push_back(poses[i]);
  constexpr std::size_t kMostGroups = 8;
  const std::size_t groups = std::min(kMostGroups, agreeing.size() / 2);
  return jackknife_sigma_m(T, groups, points, [&](std::size_t group) {
    std::vector<bool> kept(agreeing.size());
    for (std::size_t i = 0; i < kept.size(); ++i) kept[i] = i * groups / kept.size() != group;
    return carried_by(agreeing, kept);
  });
}

std::optional<PictureAgreement> Follower::recognise(Sim3& T, std::size_t pictures, PictureDetail detail,
                                                    double* sigma_m) const {
  if (!services_.locate) return std::nullopt;
  constexpr int kRounds = 2;  // what the first finds puts the others nearer to where they are looked for
  std::optional<PictureAgreement> agreement;
  for (int round = 0; round < kRounds; ++round) {
    const LocatedPictures located = services_.locate(T, pictures, detail);
    const std::vector<LocatedPose> poses = poses_of(located);
    constexpr std::size_t kFewest = 3;
    if (poses.size() < kFewest) return PictureAgreement{.tried = located.tried, .located = poses.size()};
    const LocatedPosesFit fit = fit_located_poses(poses, T);
    if (fit.agreeing < kFewest) return agreement_of(located, fit.agrees, T, evidence_.path);
    const std::vector<bool> used = detail == PictureDetail::kFine ? with_bending_stretches(poses, fit) : fit.agrees;
    const Sim3 carried = carried_by(poses, used);
    agreement = agreement_of(located, fit.agrees, carried, evidence_.path);
    T = carried;
    if (sigma_m != nullptr) *sigma_m = sigma_of_pictures_m(poses, used, carried, spread_of(few_));
    if (agreement->located == agreement->tried) break;
  }
  return agreement;
}

double Follower::viewing_distance_m(const Sim3& T) const {
  if (!few_.has_viewpoints()) return 0.0;
  std::vector<double> distances;
  for (std::size_t i = 0; i < few_.size(); ++i) distances.push_back((few_.positions[i] - few_.viewpoints[i]).norm());
  const auto half = distances.begin() + static_cast<std::ptrdiff_t>(distances.size() / 2);
  std::nth_element(distances.begin(), half, distances.end());
  return T.scale * *half;
}

// ---- choosing ----

/// Better first: recognised by its pictures, then by the rays.
bool is_better(const Candidate& a, const Candidate& b) {
  if (a.is_recognised() != b.is_recognised()) return a.is_recognised();
  return a.ray_score() > b.ray_score();
}

/// The few starts that look best as they are: rays alone, nothing moved yet.
std::vector<Start> most_promising(std::vector<Start> starts, const Follower& follower, std::size_t most) {
  if (starts.size() <= most) return starts;
  std::vector<std::pair<double, std::size_t>> order;
  for (std::size_t k = 0; k < starts.size(); ++k) {
    const auto rays = follower.rays(starts[k].T);
    constexpr double kRankWeight = 0.01;  // the order that the starts came in decides between equals
    order.emplace_back((rays ? -rays->score : 0.0) + kRankWeight * static_cast<double>(k), k);
  }
  std::ranges::sort(order);
  std::vector<Start> chosen;
  for (std::size_t k = 0; k < most; ++k) chosen.push_back(starts[order[k].second]);
  return chosen;
}

/// Follows the starts until one is recognised beyond doubt; all ends so far, best first.
void follow_all(const std::vector<Start>& starts, const Follower& follower, const RegistrationOptions& options,
                std::vector<Candidate>& candidates, Registration& result) {
  std::vector<Candidate> here;
  for (const Start& start : starts) {
    here.push_back(follower.follow(start));
    ++result.starts_tried;
  }
  std::ranges::stable_sort(here, is_better);
  for (Candidate& candidate : here) {
    candidate.pictures = follower.recognise(candidate.T, options.few_pictures);
    if (candidate.is_recognised()) break;
    candidate.T = candidate.fit.T_target_source;
  }
  candidates.insert(candidates.end(), here.begin(), here.end());
  std::ranges::stable_sort(candidates, is_better);
}

/// Whether no further place need be looked for.
bool is_convincing(const Candidate& candidate) {
  constexpr double kRays = 0.55;
  return candidate.is_recognised() || (!candidate.pictures && candidate.start.known && candidate.ray_score() > kRays);
}

/// By leaving out stretches of the flight: points of keyframes that follow one another.
double sigma_of_shapes_m(const ObservedPoints& points, const Surface& surface, const SurfaceFitOptions& options,
                         const Sim3& T, const PointSpread& spread) {
  constexpr std::size_t kGroups = 6, kPoints = 12000;
  const ObservedPoints few = thinned(points, kPoints);
  std::size_t keyframes = few.size();  // without keyframes, points in their order
  if (!few.keyframe.empty()) keyframes = 1 + *std::ranges::max_element(few.keyframe);
  const std::size_t groups = std::min(kGroups, keyframes);
  return jackknife_sigma_m(T, groups, spread, [&](std::size_t group) {
    ObservedPoints kept;
    for (std::size_t i = 0; i < few.size(); ++i) {
      const std::size_t key = few.keyframe.empty() ? i : few.keyframe[i];
      if (key * groups / keyframes == group) continue;
      kept.positions.push_back(few.positions[i]);
      if (few.has_viewpoints()) kept.viewpoints.push_back(few.viewpoints[i]);
      if (!few.distance_sigma.empty()) kept.distance_sigma.push_back(few.distance_sigma[i]);
      if (!few.keyframe.empty()) kept.keyframe.push_back(few.keyframe[i]);
    }
    if (kept.positions.empty()) return T;
    return fit_to_surface(kept, surface.index, surface.mesh, T, options).T_target_source;
  });
}

/// Textures may repeat (tiles of a floor, a modelled place): over ground that does not hold a map, the same pictures
/// then fit a step aside as well, if not as well. Looks around, and moves to where they fit better. Returns how far
/// away others fit equally well, if any do.
std::optional<double> look_for_repetition(const Follower& follower, const PointSpread& spread, Sim3& T) {
  constexpr std::size_t kPictures = 4;
  constexpr int kDirections = 8;
  constexpr double kBetter = 0.02, kEqual = 0.01, kLeastApart_m = 0.05;
  constexpr double kResolved = 0.01;  // of the viewing distance: some pixels; what repeats in less is not seen
  const auto here = follower.recognise(T, kPictures);
  if (!here) return std::nullopt;
  const double least_apart_m = std::max(kLeastApart_m, kResolved * follower.viewing_distance_m(T));
  double best = here->correlation;
  std::vector<std::pair<double, Sim3>> ends;
  for (const double share : {0.02, 0.04, 0.08}) {  // of the distance that the place is seen from
    for (int k = 0; k < kDirections; ++k) {
      const double angle = 2.0 * std::numbers::pi * k / kDirections;
      const double step_m = share * follower.viewing_distance_m(T);
      Sim3 aside = T;
      aside.translation += step_m * Vec3(std::cos(angle), std::sin(angle), 0.0);
      const auto there = follower.recognise(aside, kPictures);
      if (there && there->agreeing == there->tried) ends.emplace_back(there->correlation, aside);
    }
  }
  const Sim3 begun = T;
  for (const auto& [correlation, end] : ends) {
    if (correlation > best + kBetter || (T.matrix() != begun.matrix() && correlation > best))
      best = correlation, T = end;
  }
  // Small pictures end a little apart anyway: what may be another place is looked at closely.
  Sim3 here_closely = T;
  std::optional<PictureAgreement> best_closely;
  for (const auto& [correlation, end] : ends) {
    if (rms_motion_m(T, end, spread) < least_apart_m || correlation < best - kEqual) continue;
    if (!best_closely) best_closely = follower.recognise(here_closely, kPictures, PictureDetail::kFine);
    Sim3 end_closely = end;
    const auto there = follower.recognise(end_closely, kPictures, PictureDetail::kFine);
    if (!best_closely || !there || there->agreeing < there->tried) continue;
    const double apart_m = rms_motion_m(here_closely, end_closely, spread);
    if (apart_m > least_apart_m && there->correlation > best_closely->correlation - kEqual) return apart_m;
  }
  return std::nullopt;
}

/// The steps of register_map(), with what they leave each other.
class MapRegistration {
 public:
  MapRegistration(const ObservedPoints& points, const RegistrationEvidence& evidence, const Surface& surface,
                  const RegistrationServices& services, const RegistrationOptions& options)
      : points_(points),
        evidence_(evidence),
        surface_(surface),
        services_(services),
        options_(options),
        follower_(points, evidence, surface, services, options),
        spread_(spread_of(follower_.few())) {}

  Registration run(const Progress& progress) {
    constexpr std::int64_t kSteps = 4;
    const auto report = [&](std::int64_t step) { report_progress(progress, step, kSteps, "aligning the map"); };
    report(0);
    follow(given_starts(evidence_));
    follow_telemetry();
    report(1);
    follow_places();
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

  void follow(const std::vector<Start>& starts) {
    constexpr std::size_t kMostTurns = 8;
    follow_all(most_promising(starts, follower_, kMostTurns), follower_, options_, candidates_, result_);
  }

  void follow_telemetry() {
    if (evidence_.positions.empty() || evidence_.path.empty()) return;
    result_.telemetry = align_trajectory(evidence_.path, evidence_.positions, options_.trajectory);
    const auto follow_from = [&](const std::optional<RotationEstimate>& rotation, const std::string& name) {
      if (!is_settled()) follow(starts_by_telemetry(evidence_, *result_.telemetry, rotation, name));
    };
    if (const auto rotation = rotation_by_attitude(evidence_.path, evidence_.attitudes))
      follow_from(rotation, "positions and attitude");
    if (evidence_.up) follow_from(upright(*evidence_.up), "positions and gravity");
    follow_from(std::nullopt, "positions");
  }

  void follow_places() {
    for (const auto& look : {services_.recognize_places, services_.look_for_places}) {
      if (is_settled() || !look) continue;
      std::vector<Start> places;
      for (const Sim3& T : look()) places.push_back({T, "places"});
      if (!recognise_at_once(places)) follow(places);
    }
  }

  /// A place that was found by its looks may be right as it is: then the pictures say so, and no shapes need be
  /// followed from all the others.
  bool recognise_at_once(const std::vector<Start>& places) {
    for (const Start& place : places) {
      Candidate candidate{.start = place, .T = place.T};
      candidate.pictures = follower_.recognise(candidate.T, options_.few_pictures);
      if (!candidate.is_recognised()) continue;
      const Sim3 T = candidate.T;
      const std::optional<PictureAgreement> pictures = candidate.pictures;
      candidate = follower_.follow({T, place.name});
      candidate.start = place;
      candidate.T = T;
      candidate.pictures = pictures;
      candidates_.insert(candidates_.begin(), std::move(candidate));
      ++result_.starts_tried;
      return true;
    }
    return false;
  }

  /// The best end, and how good the best of the others is.
  Candidate chosen() {
    if (candidates_.empty()) {
      throw InputError("alignment",
                       "nothing says where the map belongs, and no place was found where it looks like the ground "
                       "truth; give positions (gps.csv), a start, or a larger region");
    }
    const Candidate& best = candidates_.front();
    const Mat3 about_mean = spread_.second_moment - spread_.mean * spread_.mean.transpose();
    constexpr double kSame = 0.02, kSame_m = 0.5;  // of the map's size, and at least
    const double same_m = std::max(kSame_m, kSame * best.T.scale * std::sqrt(about_mean.trace()));
    for (std::size_t k = 1; k < candidates_.size() && !result_.rival_apart_m; ++k) {
      const double apart_m = rms_motion_m(best.T, candidates_[k].T, spread_);
      if (apart_m < same_m) continue;
      result_.rival_apart_m = apart_m;
      result_.rival_score = candidates_[k].ray_score();
    }
    return best;
  }

  /// By the pictures where they are recognised, else by the shapes; the shapes' fit is made in any case.
  void finish(Candidate& best) {
    Sim3 T = best.T;
    constexpr double kWeak = 0.03;  // of Constraint::strengths
    const bool weak = best.fit.constraint.strengths.empty() || best.fit.constraint.strengths.front() < kWeak;
    if (best.is_recognised() && weak) result_.repeated_apart_m = look_for_repetition(follower_, spread_, T);
    if (best.is_recognised())
      best.pictures = follower_.recognise(T, options_.many_pictures, PictureDetail::kFine, &result_.sigma_m);
    const bool by_pictures = best.is_recognised() && options_.regions.empty();
    const ObservedPoints many = thinned(points_, options_.fine_points);
    SurfaceFitOptions fit = follower_.fit_options(best.start, {1.0, 0.5});
    if (!options_.regions.empty()) fit.regions = options_.regions;
    if (best.is_recognised()) fit.known.reset();
    result_.surface = fit_to_surface(many, surface_.index, surface_.mesh, T, fit);
    if (!by_pictures) {
      fit.radii_m = {0.5};
      result_.sigma_m = sigma_of_shapes_m(many, surface_, fit, result_.surface.T_target_source, spread_);
    }
    result_.start = best.start.name;
    result_.method = by_pictures ? "pictures" : "surface";
    result_.T_local_map = by_pictures ? T : result_.surface.T_target_source;
    result_.pictures = best.pictures;
    result_.rays = follower_.rays(result_.T_local_map);
    result_.moved_from_start_m = rms_motion_m(best.start.T, result_.T_local_map, spread_);
  }

  const ObservedPoints& points_;
  const RegistrationEvidence& evidence_;
  const Surface& surface_;
  const RegistrationServices& services_;
  const RegistrationOptions& options_;
  Follower follower_;
  PointSpread spread_;
  std::vector<Candidate> candidates_;  ///< best first
  Registration result_;
};

}  // namespace

Registration register_map(const ObservedPoints& points, const RegistrationEvidence& evidence, const Surface& surface,
                          const RegistrationServices& services, const RegistrationOptions& options,
                          const Progress& progress) {
  if (points.positions.empty()) throw InputError("map", "has no points; there is nothing to align");
  return MapRegistration(points, evidence, surface, services, options).run(progress);
}

}  // namespace tileflight::alignment
