#pragma once

// Brings a monocular trajectory into metres and level with an inertial unit's samples, or says why that is not
// possible.

#include <string>
#include <vector>

#include "tileflight/core/base/warning.h"
#include "tileflight/core/geometry/trajectory.h"
#include "tileflight/slam/inertial/imu_samples.h"
#include "tileflight/slam/inertial/visual_keyframe.h"

namespace tileflight::inertial {

using Mat12 = Eigen::Matrix<double, 12, 12>;

/// Input of align_to_gravity().
struct InertialInput {
  std::vector<geometry::ImuSample> samples;
  ImuModel model;
  std::string where = "imu.csv";  ///< name of the samples in messages
};

/// Conditions for the scale to count as known. Chosen by hand.
struct InertialLimits {
  double max_sigma_log_scale = 0.02;      ///< of the scale's mean over the flight
  double max_residual_ratio = 4.0;        ///< root mean square of the samples' residuals over their sigmas
  double min_covered_share = 0.5;         ///< of the flight's time, with whole samples
  double max_mounting_error_rad = 0.087;  ///< between the given mounting and the one estimated from the rotations
};

/// Result of align_to_gravity(). Vectors have an entry for each keyframe. Without `metric` only `reason`, `warnings`
/// and the numbers that are known are set.
struct InertialAlignment {
  bool metric = false;
  bool was_metric = false;  ///< the map was in metres before; without `metric` it still is, but not level
  std::string reason;       ///< why the scale is not known, or the vertical of a map in metres; empty if it is
  Warnings warnings;

  std::vector<geometry::SE3> T_world_camera;  ///< metres, z up; the first keyframe is at the origin and the map's
                                              ///< heading is kept
  std::vector<double> scale;                  ///< metres per map unit
  std::vector<geometry::Vec3> velocity_m_s;   ///< of the unit, in the world's axes
  std::vector<geometry::ImuBias> bias;

  /// Covariance of the unit's state at the latest keyframe, a prior for later estimates: tilt about the world's x and y
  /// axis, the scale's logarithm, velocity in the unit's axes, gyroscope's and accelerometer's bias.
  Mat12 latest_covariance = Mat12::Zero();
  geometry::SE3 T_imu_camera;  ///< the given one, its rotation refined

  double mean_scale = 0.0;
  double sigma_log_scale = 0.0;  ///< of the logarithm of the mean scale
  double sigma_up_rad = 0.0;     ///< of the vertical at the first keyframe
  double time_offset_s = 0.0;    ///< the unit's clock minus the camera's
  double sigma_time_offset_s = 0.0;
  double mounting_correction_rad = 0.0;  ///< angle between the given and the estimated T_cam_imu
  double covered_share = 0.0;            ///< of the time between first and last keyframe, with whole samples
  double residual_ratio = 0.0;  ///< root mean square of the samples' residuals over their sigmas; 1 if these are right
};

/// Returns the result for the same motion played backwards: times, velocities, the gyroscope's biases and the clocks'
/// offset change their signs, and keyframes their order. `latest_covariance` is not kept.
InertialAlignment reversed(InertialAlignment alignment);

/// Estimates scale, vertical, velocities and biases, with the clocks' offset, and corrects the path by them
/// (visual_inertial_problem.h). `images`: poses of all images in the map, for the clocks' offset. Throws InputError for
/// samples of which no estimate can be made (imu_check.h), also if they and the images have no time in common.
InertialAlignment align_to_gravity(const std::vector<VisualKeyframe>& keyframes, const geometry::Trajectory& images,
                                   const InertialInput& input, const InertialLimits& limits = {});

}  // namespace tileflight::inertial
