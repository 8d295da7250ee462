#pragma once

// For the tests of odometry: flights over a relief (synthetic_scene.h) as odometry input, with ground truth.

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <vector>

#include "tileflight/core/base/order_statistics.h"
#include "tileflight/core/geometry/trajectory.h"
#include "tileflight/slam/keyframes/options.h"
#include "tileflight/slam/keyframes/synthetic_scene.h"
#include "tileflight/slam/odometry/odometry.h"
#include "tileflight/slam/odometry/prior_alignment.h"

namespace tileflight::odometry::test_support {

struct Sequence {
  imaging::Calibration calibration;
  std::vector<geometry::SE3> truth;  ///< T_local_camera
  std::vector<imaging::RgbImage> images;

  FrameSource source() const {
    return [this, next = std::size_t{0}]() mutable -> std::optional<InputFrame> {
      if (next >= images.size()) return std::nullopt;
      InputFrame frame;
      frame.index = static_cast<std::int64_t>(next);
      frame.time_s = static_cast<double>(next) / 30.0;
      frame.image = images[next++];
      return frame;
    };
  }
};

inline double path_length_m(const std::vector<geometry::SE3>& truth) {
  double path = 0;
  for (std::size_t i = 1; i < truth.size(); ++i) path += (truth[i].translation - truth[i - 1].translation).norm();
  return path;
}

/// RMS distance of the camera centres after alignment by a similarity, as a share of the path length.
inline double relative_ate(const geometry::Trajectory& estimate, const std::vector<geometry::SE3>& truth,
                           double fps = 30.0) {
  Eigen::Matrix3Xd from(3, estimate.size()), to(3, estimate.size());
  double path = 0;
  for (std::size_t i = 0; i < estimate.size(); ++i) {
    from.col(i) = estimate.poses[i].T_local_camera.translation;
    to.col(i) = truth[std::lround(estimate.poses[i].time_s * fps)].translation;
    if (i > 0) path += (to.col(i) - to.col(i - 1)).norm();
  }
  const Eigen::Matrix4d T = Eigen::umeyama(from, to, true);
  const Eigen::Matrix3Xd moved = (T.topLeftCorner<3, 3>() * from).colwise() + T.topRightCorner<3, 1>();
  return std::sqrt((moved - to).colwise().squaredNorm().mean()) / path;
}

inline keyframes::OdometryOptions small_options() {
  keyframes::OdometryOptions options;
  options.selection.points_per_keyframe = 500;
  options.window.active_points = 700;
  options.initialization.corners = 400;
  return options;
}

inline Sequence render_sequence(const imaging::Camera& camera, const keyframes::test_support::Relief& relief,
                                std::vector<geometry::SE3> truth) {
  Sequence sequence;
  sequence.calibration.camera = camera;
  const keyframes::test_support::ReliefCamera scene(camera, relief);
  for (const geometry::SE3& pose : truth) sequence.images.push_back(scene.render(pose));
  sequence.truth = std::move(truth);
  return sequence;
}

/// Similarity from estimate to truth. It uses the orientations too, because these paths are nearly straight.
inline geometry::Sim3 similarity_to_truth(const geometry::Trajectory& estimate, const std::vector<geometry::SE3>& truth,
                                          double fps = 30.0) {
  std::vector<geometry::SE3> from, to;
  for (const geometry::StampedPose& pose : estimate.poses) {
    from.push_back(pose.T_local_camera);
    to.push_back(truth[std::lround(pose.time_s * fps)]);
  }
  return similarity_from_poses(from, to).value();
}

/// Vertical distance of each aligned map point from the relief, metres.
inline std::vector<double> height_errors_m(const keyframes::test_support::Relief& relief, const OdometryResult& result,
                                           const std::vector<geometry::SE3>& truth) {
  std::vector<double> heights;
  const geometry::Sim3 T_local_map = similarity_to_truth(result.trajectory, truth);
  for (const geometry::Vec3& position : result.map.positions) {
    const geometry::Vec3 p = T_local_map * position;
    heights.push_back(std::abs(p.z() - relief.height_m(p.x(), p.y())));
  }
  return heights;
}

/// Hilly ground seen obliquely from 12 m above while moving sideways and forwards; 30 images a second.
inline keyframes::test_support::Relief hilly_ground() {
  return keyframes::test_support::sine_hills({.amplitude_m = 1.5, .k_x = 0.35, .k_y = 0.28, .phase_y = 0.5}, 0.6);
}
inline std::vector<geometry::SE3> path_over_ground(int frames) {
  std::vector<geometry::SE3> truth;
  for (int i = 0; i < frames; ++i) {
    const double s = i / 30.0;
    truth.push_back(keyframes::test_support::look_along(geometry::Vec3(3.0 * s, 5.0 * s, 12.0 + 0.5 * std::sin(s)),
                                                        geometry::Vec3(0.3 * std::sin(s), 1.0, -1.1)));
  }
  return truth;
}
inline Sequence render_hill_flight(const imaging::Camera& camera, int frames) {
  return render_sequence(camera, hilly_ground(), path_over_ground(frames));
}

/// Sideways and forwards over hills, shaken about all axes as a vehicle or a hand does.
inline geometry::SE3 shaken_pose(double time_s) {
  const geometry::Vec3 position(2.5 * time_s, 6.0 * time_s, 12.0 + 0.5 * std::sin(2.0 * time_s));
  const geometry::Vec3 shake(0.05 * std::sin(7.0 * time_s), 0.05 * std::sin(5.0 * time_s + 1.0),
                             0.06 * std::sin(6.0 * time_s));
  return keyframes::test_support::look_along(position, geometry::Vec3(0.3 * std::sin(time_s), 1.0, -1.1)) *
         geometry::SE3(geometry::so3_exp(shake), geometry::Vec3::Zero());
}

/// 30 images a second of the shaken flight; the time of a row is that of its frame plus `line_delay_s` for each row
/// below the middle.
inline Sequence shaken_flight(int frames, double line_delay_s) {
  const imaging::Camera camera = imaging::make_fisheye(320, 240, 120.0);
  const keyframes::test_support::ReliefCamera scene(camera, hilly_ground());
  Sequence sequence;
  sequence.calibration.camera = camera;
  for (int i = 0; i < frames; ++i) {
    const double time_s = i / 30.0;
    sequence.truth.push_back(shaken_pose(time_s));
    sequence.images.push_back(scene.render_by_rows(
        [&](int y) { return shaken_pose(time_s + (y - 0.5 * (camera.height() - 1)) * line_delay_s); }));
  }
  return sequence;
}

}  // namespace tileflight::odometry::test_support
