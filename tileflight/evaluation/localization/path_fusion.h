#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <optional>
#include <vector>

#include "tileflight/core/geometry/transform.h"

namespace tileflight::localization {

/// Motion of the camera from an image to the next one, as an odometry estimated it.
struct PathStep {
  geometry::SE3 T_this_next;        ///< translation in units of the odometry's map
  double sigma_translation = 0.0;   ///< for each axis, units of the map
  double sigma_rotation_rad = 0.0;  ///< for each axis
};

/// Pose of an image that was found in the place, independently of the odometry.
struct PoseMeasurement {
  geometry::SE3 T_local_camera;
  /// Covariance of a small motion x of the camera in its own axes, T_local_camera exp(x): translation (m), rotation.
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Identity();
  /// Number of images that share the measurement's error, since they show the same ground: the measurement counts for
  /// one over this number.
  double shared_by = 1.0;
};

/// Pose of an image by all measurements and steps.
struct FusedPose {
  geometry::SE3 T_local_camera;
  /// Covariance of a small motion of the camera in its own axes, as in PoseMeasurement.
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
  double scale = 1.0;       ///< metres per unit of the map, from this image to the next
  double deviation = 0.0;   ///< of the measurement, in its own sigmas (root mean square over six); 0: there is none
  bool is_outlier = false;  ///< the measurement contradicts the others, and does not count
};

struct FusionOptions {
  double scale = 1.0;            ///< metres per unit of the map at the start
  double sigma_log_scale = 0.3;  ///< of that scale; 0: it is held
  double scale_walk = 0.003;     ///< sigma of the change of the scale's logarithm over one metre of path, for its drift
  double kernel = 3.0;           ///< deviation beyond which a measurement is an outlier, in sigmas
};

struct FusedPath {
  std::vector<FusedPose> poses;  ///< one for each image
  double noise = 1.0;  ///< observed over stated sigma of the measurements, at least 1; counted in the covariances
};

/// Fuses located images with the odometry's steps between them: the poses of all images, and the scale along the path,
/// that are most probable (Gauss-Newton on a chain of poses; Geman-McClure weights of the measurements, with a kernel
/// that narrows from iteration to iteration). The covariances are marginals of the whole chain. Cost and memory grow
/// with the number of images.
///
/// `start`: a pose of each image to begin with. `steps`: one fewer; nullopt: the odometry knows nothing of the motion
/// there. `measurements`: one for each image; nullopt: the image was not found. Throws InputError if the sizes differ
/// or if nothing was found.
FusedPath fuse_path(const std::vector<geometry::SE3>& start, const std::vector<std::optional<PathStep>>& steps,
                    const std::vector<std::optional<PoseMeasurement>>& measurements, const FusionOptions& options = {});

}  // namespace tileflight::localization
