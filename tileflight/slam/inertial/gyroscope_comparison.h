#pragma once

// The camera's rotation rates compared with the gyroscope's: offset of the clocks, units, mounting of the unit.

#include <span>
#include <string>

#include "tileflight/core/geometry/trajectory.h"
#include "tileflight/slam/inertial/imu_samples.h"

namespace tileflight::inertial {

/// Result of compare_gyroscope(). Shares are of the variance of the gyroscope's mean rates from image to image.
struct GyroscopeComparison {
  bool determined = false;  ///< whether offset, factor and rotation are known
  double offset_s = 0.0;    ///< the unit's clock minus the camera's
  double sigma_s = 0.0;
  double rate_factor = 1.0;  ///< the gyroscope's rates over the camera's: 57.3 if they are in degrees
  Eigen::Quaterniond R_imu_camera = Eigen::Quaterniond::Identity();  ///< that fits best
  double explained_share = 0.0;  ///< by the camera's rates, turned by the given mounting
  double best_share = 0.0;       ///< by the camera's rates, turned by the rotation that fits best
  std::string reason;            ///< why it is not determined
};

/// `path`: the camera's poses in any frame. `R_imu_camera`: the mounting as given.
GyroscopeComparison compare_gyroscope(const geometry::Trajectory& path, std::span<const geometry::ImuSample> samples,
                                      const Eigen::Quaterniond& R_imu_camera);

}  // namespace tileflight::inertial
