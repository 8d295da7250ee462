#include "tileflight/slam/odometry/run_comparison.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include "tileflight/slam/odometry/prior_alignment.h"

namespace tileflight::odometry {

namespace {

/// Where later runs begin, as shares of the images. Of three flights over roofs that repeat, whose forward runs begin
/// wrongly at the first image and after an eighth, two begin rightly after a third.
constexpr std::array kLaterStarts{0.15, 0.3, 0.5};
/// At the latest: the images before are kept until then.
constexpr std::size_t kLatestStart = 150;

/// The part of a run that the comparison needs.
struct ComparedRun {
  RunStart start;
  geometry::Trajectory path;
  bool has_warnings = false;
};

bool agree(const ComparedRun& a, const ComparedRun& b, const WarningThresholds& limits) {
  const auto agreement = measure_agreement(a.path, b.path);
  return agreement && agreement->rms_share <= limits.disagreement;
}

/// The first of a direction's runs without warnings that another run of it agrees with, and that other; null: none.
std::pair<const ComparedRun*, const ComparedRun*> find_repeated(const std::vector<ComparedRun>& runs, bool against,
                                                                const WarningThresholds& limits) {
  for (std::size_t i = 0; i < runs.size(); ++i) {
    for (std::size_t j = i + 1; j < runs.size(); ++j) {
      const ComparedRun &a = runs[i], &b = runs[j];
      if (a.start.against != against || b.start.against != against || (a.has_warnings && b.has_warnings)) continue;
      if (agree(a, b, limits)) return a.has_warnings ? std::pair(&b, &a) : std::pair(&a, &b);
    }
  }
  return {nullptr, nullptr};
}

/// Decides between two directions that disagree, by runs that begin later.
class LaterRuns {
 public:
  LaterRuns(const OdometryResult& run, const OdometryResult& other, std::size_t images, const FurtherRun& track,
            const WarningThresholds& limits)
      : images_(images), track_(track), limits_(limits) {
    keep({.against = false, .image = 0}, run);
    keep({.against = true, .image = 0}, other);
  }

  /// Sets what is to be used, and what it is compared with, if one direction shows its path again and the other does
  /// not.
  void decide(DirectionCheck& check) {
    for (const double share : kLaterStarts) {
      const std::size_t image = std::min(kLatestStart, static_cast<std::size_t>(share * static_cast<double>(images_)));
      if (image <= runs_.back().start.image) return;
      for (const bool against : {false, true})
        keep({.against = against, .image = image}, track_({.against = against, .image = image}));
      const auto same = find_repeated(runs_, false, limits_), other = find_repeated(runs_, true, limits_);
      if (same.first == nullptr && other.first == nullptr) continue;
      const bool are_both = same.first != nullptr && other.first != nullptr;
      if (are_both && !agree(*same.first, *other.first, limits_)) return;  // the scale changed on the way
      const bool is_same = other.first == nullptr || (are_both && same.first->start.image <= other.first->start.image);
      const auto& [use, again] = is_same ? same : other;
      check.use = use->start;
      check.counterpart = counterpart_of(*use, *again);
      return;
    }
  }

 private:
  void keep(const RunStart& start, const OdometryResult& result) {
    runs_.push_back({start, result.trajectory, has_own_warnings(result, limits_)});
  }

  /// A run against the one that is used, if any agrees with it.
  const geometry::Trajectory& counterpart_of(const ComparedRun& use, const ComparedRun& again) const {
    for (const ComparedRun& run : runs_) {
      if (run.start.against != use.start.against && agree(use, run, limits_)) return run.path;
    }
    return again.path;
  }

  std::size_t images_;
  const FurtherRun& track_;
  const WarningThresholds& limits_;
  std::vector<ComparedRun> runs_;
};

}  // namespace

DirectionCheck check_directions(const OdometryResult& run, std::size_t images, bool may_use_other,
                                const FurtherRun& track, const WarningThresholds& limits) {
  const OdometryResult other = track({.against = true, .image = 0});
  const auto agreement = measure_agreement(run.trajectory, other.trajectory);
  const RunChoice choice = choose_run(run, other, agreement, limits);
  DirectionCheck check{.use = {}, .disagreement = {}, .counterpart = other.trajectory};
  if (choice == RunChoice::kOpen || choice == RunChoice::kRatherSecond) check.disagreement = agreement;
  if (!may_use_other) return check;
  check.use.against = choice == RunChoice::kSecond || choice == RunChoice::kRatherSecond;
  if (check.use.against) check.counterpart = run.trajectory;
  if (check.disagreement) LaterRuns(run, other, images, track, limits).decide(check);
  return check;
}

namespace {

constexpr double kSameTime_s = 1e-6;

/// The trajectory's pose at `time_s`, or nullptr if it has none there.
const geometry::SE3* find_pose(const geometry::Trajectory& trajectory, double time_s) {
  const auto found =
      std::lower_bound(trajectory.poses.begin(), trajectory.poses.end(), time_s - kSameTime_s,
                       [](const geometry::StampedPose& pose, double time) { return pose.time_s < time; });
  if (found == trajectory.poses.end() || found->time_s > time_s + kSameTime_s) return nullptr;
  return &found->T_local_camera;
}

/// Ratio of lengths in the first trajectory to lengths in the second.
std::optional<double> estimate_relative_scale(const geometry::Trajectory& first, const geometry::Trajectory& second) {
  std::vector<geometry::SE3> from, to;
  for (const auto& [a, b] : geometry::associate(first, second, kSameTime_s)) {
    from.push_back(second.poses[b].T_local_camera);
    to.push_back(first.poses[a].T_local_camera);
  }
  const auto similarity = similarity_from_poses(from, to);
  return similarity && similarity->scale > 0.0 ? std::optional(similarity->scale) : std::nullopt;
}

/// Camera centres moved by the similarity; without one, since paths that run against each other fit at no positive
/// scale, all at the other path's middle, the best that scale zero does.
std::vector<geometry::Vec3> aligned_centres(const std::optional<geometry::Sim3>& similarity,
                                            const std::vector<geometry::SE3>& from,
                                            const std::vector<geometry::SE3>& to) {
  std::vector<geometry::Vec3> moved;
  geometry::Vec3 middle = geometry::Vec3::Zero();
  for (const geometry::SE3& pose : to) middle += pose.translation / static_cast<double>(to.size());
  for (const geometry::SE3& pose : from)
    moved.push_back(similarity ? geometry::Vec3(*similarity * pose.translation) : middle);
  return moved;
}

}  // namespace

std::optional<RunAgreement> measure_agreement(const geometry::Trajectory& first, const geometry::Trajectory& second,
                                              std::size_t least) {
  const auto pairs = geometry::associate(first, second, kSameTime_s);
  if (pairs.size() < least) return std::nullopt;
  std::vector<geometry::SE3> from, to;
  for (const auto& [a, b] : pairs) {
    from.push_back(second.poses[b].T_local_camera);
    to.push_back(first.poses[a].T_local_camera);
  }
  const auto similarity = similarity_from_poses(from, to);
  const std::vector<geometry::Vec3> moved = aligned_centres(similarity, from, to);
  RunAgreement result{.pictures = pairs.size()};
  double path = 0.0, path_moved = 0.0, squares = 0.0, worst = 0.0;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const double distance = (moved[i] - to[i].translation).norm();
    squares += distance * distance;
    if (i > 0) {
      path += (to[i].translation - to[i - 1].translation).norm();
      path_moved += (moved[i] - moved[i - 1]).norm();
    }
    if (distance <= worst) continue;
    worst = distance;
    result.worst_time_s = first.poses[pairs[i].first].time_s;
  }
  if (path_moved > 0.0) path = std::min(path, path_moved);
  if (!(path > 0.0)) return std::nullopt;
  result.rms_share = std::sqrt(squares / static_cast<double>(pairs.size())) / path;
  result.worst_share = worst / path;
  return result;
}

std::optional<Dispersion> estimate_dispersion(const geometry::Trajectory& first, const geometry::Trajectory& keyframes,
                                              const std::vector<tracking::FrameQuality>& quality,
                                              const geometry::Trajectory& second, std::size_t least) {
  const auto scale = estimate_relative_scale(first, second);
  if (!scale) return std::nullopt;
  Dispersion result{.pictures = 0, .position = 0.0, .rotation = 0.0};
  for (const tracking::FrameQuality& q : quality) {
    if (!q.tracked || q.keyframe < 0 || !(q.sigma_position > 0.0) || !(q.sigma_rotation_rad > 0.0)) continue;
    const double key_time_s = keyframes.poses[static_cast<std::size_t>(q.keyframe)].time_s;
    const geometry::SE3 *here = find_pose(first, q.time_s), *key = find_pose(first, key_time_s);
    const geometry::SE3 *other_here = find_pose(second, q.time_s), *other_key = find_pose(second, key_time_s);
    if (!here || !key || !other_here || !other_key) continue;
    const geometry::SE3 step = key->inverse() * *here, other = other_key->inverse() * *other_here;
    const double apart = (step.translation - *scale * other.translation).norm() / q.sigma_position;
    const double turned = step.rotation.angularDistance(other.rotation) / q.sigma_rotation_rad;
    result.position += 0.5 * apart * apart;
    result.rotation += 0.5 * turned * turned;
    ++result.pictures;
  }
  if (result.pictures < least) return std::nullopt;
  result.position /= static_cast<double>(result.pictures);
  result.rotation /= static_cast<double>(result.pictures);
  return result;
}

void rescale_sigmas(std::vector<tracking::FrameQuality>& quality, const Dispersion& dispersion) {
  // Smallest factor on a sigma. Chosen by hand.
  constexpr double kLeast = 0.5;
  const double position = std::max(kLeast, std::sqrt(dispersion.position));
  const double rotation = std::max(kLeast, std::sqrt(dispersion.rotation));
  for (tracking::FrameQuality& q : quality) {
    q.sigma_position *= position;
    q.sigma_rotation_rad *= rotation;
  }
}

}  // namespace tileflight::odometry
