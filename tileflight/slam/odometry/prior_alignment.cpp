#include "tileflight/slam/odometry/prior_alignment.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "tileflight/core/base/input_error.h"

namespace tileflight::odometry {
namespace {

using geometry::SE3;
using geometry::Sim3;
using geometry::Vec3;

/// The mean rotation: Markley et al., "Averaging quaternions", 2007, eq. 12 (largest eigenvector of the sum of q q^T).
Eigen::Quaterniond mean_rotation(const std::vector<Eigen::Quaterniond>& rotations) {
  Eigen::Matrix4d sum = Eigen::Matrix4d::Zero();
  for (const Eigen::Quaterniond& q : rotations) sum += q.coeffs() * q.coeffs().transpose();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix4d> eigen(sum);
  return Eigen::Quaterniond(Eigen::Vector4d(eigen.eigenvectors().col(3)));
}

Sim3 similarity_from_known_poses(const geometry::Trajectory& known, double until_s, const OdometryResult& result) {
  geometry::Trajectory beginning = result.trajectory;
  std::erase_if(beginning.poses, [&](const geometry::StampedPose& pose) { return pose.time_s > until_s; });
  std::vector<SE3> T_map_camera, T_world_camera;
  for (const auto& [ours, theirs] : geometry::associate(beginning, known)) {
    T_map_camera.push_back(beginning.poses[ours].T_local_camera);
    T_world_camera.push_back(known.poses[theirs].T_local_camera);
  }
  const auto similarity = similarity_from_poses(T_map_camera, T_world_camera);
  if (similarity) return *similarity;
  throw InputError("known poses", std::to_string(T_map_camera.size()) +
                                      " of them match the times of the first keyframes, but at least two at different "
                                      "positions are needed; check that both have the same clock");
}

/// Ratio of the depth image's depth to the map's depth, for each point that the keyframe hosts.
std::vector<double> depth_ratios(const imaging::Camera& camera, const OdometryResult& result, int keyframe,
                                 const imaging::FloatImage& depth_m) {
  if (depth_m.width != camera.width() || depth_m.height != camera.height())
    throw InputError("depth", "is " + std::to_string(depth_m.width) + "x" + std::to_string(depth_m.height) +
                                  ", the calibration is for " + std::to_string(camera.width()) + "x" +
                                  std::to_string(camera.height()));
  std::vector<double> ratios;
  const SE3 T_camera_map = result.keyframes.poses[keyframe].T_local_camera.inverse();
  for (std::size_t i = 0; i < result.map.size(); ++i) {
    if (result.map_point_keyframes[i].front() != keyframe) continue;
    const Vec3 point = T_camera_map * result.map.positions[i];
    const auto pixel = camera.project(point);
    if (!pixel || !(point.z() > 0.0)) continue;
    const auto x = std::lround(pixel->x()), y = std::lround(pixel->y());
    if (x < 0 || y < 0 || x >= depth_m.width || y >= depth_m.height) continue;
    const double known = depth_m(static_cast<int>(x), static_cast<int>(y));
    if (std::isfinite(known) && known > 0.0) ratios.push_back(known / point.z());
  }
  return ratios;
}

double scale_from_depth(const imaging::Camera& camera, const OdometryInput& input, double until_s,
                        const OdometryResult& result) {
  std::vector<double> ratios;
  for (std::size_t k = 0; k < result.keyframes.size() && result.keyframes.poses[k].time_s <= until_s; ++k) {
    const auto depth_m = input.depth_m(result.keyframe_frame_indices[k]);
    if (!depth_m) continue;
    for (const double ratio : depth_ratios(camera, result, static_cast<int>(k), *depth_m)) ratios.push_back(ratio);
  }
  if (ratios.empty())
    throw InputError("known depth", "no point of the first keyframes has a known depth to compare with");
  const auto middle = ratios.begin() + static_cast<std::ptrdiff_t>(ratios.size() / 2);
  std::nth_element(ratios.begin(), middle, ratios.end());
  return *middle;
}

}  // namespace

std::optional<Sim3> similarity_from_poses(const std::vector<SE3>& T_map_camera,
                                          const std::vector<SE3>& T_world_camera) {
  if (T_map_camera.size() < 2) return std::nullopt;
  std::vector<Eigen::Quaterniond> rotations;
  Vec3 map_centre = Vec3::Zero(), world_centre = Vec3::Zero();
  for (std::size_t i = 0; i < T_map_camera.size(); ++i) {
    rotations.push_back(T_world_camera[i].rotation * T_map_camera[i].rotation.conjugate());
    map_centre += T_map_camera[i].translation / static_cast<double>(T_map_camera.size());
    world_centre += T_world_camera[i].translation / static_cast<double>(T_map_camera.size());
  }
  const Eigen::Quaterniond R = mean_rotation(rotations);
  double along = 0.0, squared = 0.0;  // least squares for the scale in world = scale * R * map, about the centroids
  for (std::size_t i = 0; i < T_map_camera.size(); ++i) {
    const Vec3 from = R * (T_map_camera[i].translation - map_centre);
    along += from.dot(T_world_camera[i].translation - world_centre);
    squared += from.squaredNorm();
  }
  if (!(along > 0.0)) return std::nullopt;
  const double scale = along / squared;
  return Sim3(scale, R, world_centre - scale * (R * map_centre));
}

void transform_result(const Sim3& T_world_map, OdometryResult& result) {
  result.trajectory = geometry::transformed(T_world_map, result.trajectory);
  result.keyframes = geometry::transformed(T_world_map, result.keyframes);
  result.map = geometry::transformed(T_world_map, result.map);
  const auto variance = result.map.scalars.find("inverse_depth_variance");
  if (variance == result.map.scalars.end()) return;
  const auto factor = static_cast<float>(1.0 / (T_world_map.scale * T_world_map.scale));
  for (float& value : variance->second) value *= factor;
}

std::optional<Sim3> find_T_world_map(const imaging::Camera& camera, const OdometryInput& input, double until_s,
                                     const OdometryResult& result) {
  if (result.trajectory.empty()) return std::nullopt;
  if (!input.poses.empty()) return similarity_from_known_poses(input.poses, until_s, result);
  if (!input.depth_m) return std::nullopt;
  return Sim3(scale_from_depth(camera, input, until_s, result), Eigen::Quaterniond::Identity(), Vec3::Zero());
}

void apply_priors(const imaging::Camera& camera, const OdometryInput& input, double until_s, OdometryResult& result) {
  if (const auto T_world_map = find_T_world_map(camera, input, until_s, result)) transform_result(*T_world_map, result);
}

}  // namespace tileflight::odometry
