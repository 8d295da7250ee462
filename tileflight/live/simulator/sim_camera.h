#pragma once

#include <array>
#include <optional>
#include <string>

#include "tileflight/core/imaging/camera.h"
#include "tileflight/live/simulator/settings.h"

namespace tileflight::simulator {

/// A camera with the changes made by clients. Not thread-safe: part of the simulator's state.
class SimCamera {
 public:
  explicit SimCamera(CameraSettings settings) : settings_(std::move(settings)) {}

  const std::string& name() const { return settings_.name; }
  /// Camera axes forward, right, down, relative to the vehicle's body; for external cameras to global NED.
  const geometry::SE3& T_body_camera() const { return settings_.T_body_camera; }
  void set_pose(const geometry::SE3& T_body_camera) { settings_.T_body_camera = T_body_camera; }

  /// Sets the field of view of all image types, degrees; replaces another lens. Throws InputError outside 0.1 to 179.9.
  void set_fov(double fov_deg);
  double fov_deg() const { return settings_.captures[0].fov_deg; }
  /// Sets one of Brown's coefficients K1, K2, K3, P1, P2 of pinhole lenses. Throws InputError: another name, not
  /// finite.
  void set_distortion(const std::string& name, double value);
  const std::array<double, 5>& distortion() const { return distortion_; }
  /// Sets the lens of all image types. Throws InputError for an invalid lens.
  void set_lens(const LensDescription& lens);

  int width(int image_type) const { return capture(image_type).width; }
  int height(int image_type) const { return capture(image_type).height; }
  imaging::Camera lens(int image_type) const;
  CameraInfo info(const geometry::SE3& T_ned_camera) const;
  /// The highest angular resolution of any of its images.
  double pixels_per_rad() const;

 private:
  const CaptureSettings& capture(int image_type) const {
    return settings_.captures[static_cast<std::size_t>(image_type)];
  }

  CameraSettings settings_;
  std::array<double, 5> distortion_{};
  mutable double pixels_per_rad_ = 0.0;  ///< 0: not computed yet
};

}  // namespace tileflight::simulator
