#include "tileflight/slam/odometry/run_comparison.h"

#include <algorithm>
#include <cmath>

#include "tileflight/slam/odometry/prior_alignment.h"

namespace tileflight::odometry {
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
