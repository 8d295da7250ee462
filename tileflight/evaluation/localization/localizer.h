#pragma once

#include <memory>
#include <optional>

#include "tileflight/core/geometry/transform.h"
#include "tileflight/core/imaging/camera.h"
#include "tileflight/core/imaging/image.h"
#include "tileflight/evaluation/localization/picture_localizer.h"
#include "tileflight/slam/inertial/imu_samples.h"
#include "tileflight/world/scene/scene.h"

namespace tileflight::localization {

struct LiveOptions {
  LocalizerOptions pictures{.width = 640};
  double acceleration_m_s2 = 4.0;  ///< sigma of the camera's acceleration for each axis, where its motion is unknown
  double turn_acceleration_rad_s2 = 3.0;  ///< the same of its turn rate
  double motion_sigma = 0.02;             ///< sigma of a known motion: this share of it, and 1 cm and 0.1 degrees
  double view_motion = 0.06;              ///< as FlightLocalizerOptions::view_motion
  double lost_sigma_m = 3.0;  ///< sigma of the position, three axes together, beyond which the camera is lost
  /// States noise and mounting of the inertial unit whose readings come (add_reading()); nullopt: there is none.
  std::optional<inertial::ImuModel> imu{};
  /// Tells that the camera stands still where it is started until the readings say that it moves. On the ground it sees
  /// too little to be located, and is not searched. Counts with `imu` only.
  bool starts_at_rest = false;
  int guesses = 4;  ///< poses around the expected one that are tried for an image that is not found
                    ///< there; more of them for the next images
};

/// Pose of the camera after an image.
struct LivePose {
  geometry::SE3 T_local_camera;
  /// Covariance of a small motion of the camera in its own axes, translation (m) first, rotation (rad).
  Mat6 covariance = Mat6::Identity();
  geometry::Vec3 velocity_m_s = geometry::Vec3::Zero();  ///< of the camera, local frame
  double sigma_velocity_m_s = 0.0;                       ///< of it, for each axis
  bool located = false;                                  ///< in this image; else the pose is predicted
  bool lost = false;                                     ///< the pose is too uncertain to be used
  double correlation = 0.0;                              ///< of rendered and observed grey values; 0: not located

  double sigma_position_m() const;    ///< root of the trace
  double sigma_rotation_rad() const;  ///< root of the trace
};

/// Locates the images of a camera in a place one by one, as they come. Between them the camera moves as an inertial
/// unit or an odometry says, or is assumed to keep its velocity; each image is aligned with a rendering from near its
/// expected pose. An image that is not found is searched around that pose, a few guesses an image, so that a lost
/// camera is found again when it comes back to what was expected. After a start at rest (LiveOptions::starts_at_rest)
/// and after a loss, five images must agree with the readings before they count. The result is independent of the
/// number of threads.
class Localizer {
 public:
  /// The scene must outlive it.
  Localizer(const scene::Scene& scene, const imaging::Camera& camera, const LiveOptions& options = {});
  /// Shares the appearance with other users of the scene.
  Localizer(const scene::Scene& scene, std::shared_ptr<const render::Appearance> appearance,
            const imaging::Camera& camera, const LiveOptions& options = {});
  ~Localizer();
  Localizer(const Localizer&) = delete;
  Localizer& operator=(const Localizer&) = delete;

  /// Replaces the tiles that it sees of the place, as a camera moves on. Both must outlive it, or the next call.
  void use(const scene::Scene& scene, std::shared_ptr<const render::Appearance> appearance);

  /// Sets where the camera is at a time; the next image is searched from there. `sigma_m`, `sigma_rad`: for each axis.
  void start(const geometry::SE3& T_local_camera, double time_s, double sigma_m = 0.5, double sigma_rad = 0.02);

  /// Adds a reading of the inertial unit. Those up to an image's time are to be added before it.
  void add_reading(const geometry::ImuSample& reading);

  /// Locates the next image. `T_last_this`: the camera's motion since the last image, metres, if it is known; it goes
  /// before the readings. Throws InputError before start(), for a time that does not increase, and for an image of
  /// another size.
  LivePose add(const imaging::RgbImage& image, double time_s, const std::optional<geometry::SE3>& T_last_this = {});

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tileflight::localization
