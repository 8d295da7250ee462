#include "tileflight/live/simulator/sim_camera.h"

#include <algorithm>
#include <cmath>

#include "tileflight/core/base/input_error.h"
#include "tileflight/live/simulator/camera_settings.h"
#include "tileflight/live/simulator/frames.h"
#include "tileflight/tiles/tileset/view_criteria.h"

namespace tileflight::simulator {
namespace {

using imaging::Camera;

constexpr std::array<const char*, 5> kDistortionNames{"K1", "K2", "K3", "P1", "P2"};
constexpr double kMaxDistortion = 100.0;
constexpr double kNearPlane_cm = 10.0;

/// The pinhole with Brown's distortion: OpenCV's order is k1 k2 p1 p2 k3.
Camera with_distortion(const Camera& lens, const std::array<double, 5>& k) {
  const auto* pinhole = std::get_if<imaging::PinholeRadtan>(&lens.model());
  const bool any = std::ranges::any_of(k, [](double value) { return value != 0.0; });
  if (pinhole == nullptr || !any) return lens;
  imaging::PinholeRational model{pinhole->fx, pinhole->fy, pinhole->cx, pinhole->cy, {}};
  model.d[0] = k[0];
  model.d[1] = k[1];
  model.d[2] = k[3];
  model.d[3] = k[4];
  model.d[4] = k[2];
  return {model, lens.width(), lens.height()};
}

}  // namespace

void SimCamera::set_fov(double fov_deg) {
  if (!(fov_deg >= 0.1 && fov_deg <= 179.9))
    throw InputError("camera '" + name() + "'", "the field of view must be from 0.1 to 179.9 degrees");
  for (CaptureSettings& capture : settings_.captures) {
    capture.fov_deg = fov_deg;
    capture.lens.reset();
  }
  pixels_per_rad_ = 0.0;
}

void SimCamera::set_distortion(const std::string& key, double value) {
  const auto at = std::ranges::find(kDistortionNames, key);
  if (at == kDistortionNames.end())
    throw InputError("camera '" + name() + "'",
                     "'" + key.substr(0, 20) + "' is not a distortion parameter; use K1, K2, K3, P1 or P2");
  if (!(std::abs(value) <= kMaxDistortion))
    throw InputError("camera '" + name() + "'", key + " must be from -100 to 100");
  distortion_[static_cast<std::size_t>(at - kDistortionNames.begin())] = value;
  pixels_per_rad_ = 0.0;
}

void SimCamera::set_lens(const LensDescription& lens) {
  std::array<CaptureSettings, kImageTypeCount> captures = settings_.captures;
  for (CaptureSettings& capture : captures) {
    if (lens.width != 0) capture.width = lens.width;
    if (lens.height != 0) capture.height = lens.height;
    capture.lens = lens;
    make_lens(capture, "camera '" + name() + "'");
  }
  settings_.captures = captures;
  pixels_per_rad_ = 0.0;
}

Camera SimCamera::lens(int image_type) const {
  return with_distortion(make_lens(capture(image_type), "camera '" + name() + "'"), distortion_);
}

/// AirSim's projection matrix: Unreal's perspective with reversed depth and no far plane, after a change of axes that
/// negates the forward axis, so that clip coordinates have w = -x (for x forward, y right, z down, 1). Both axes have
/// the scale of the longer side.
CameraInfo SimCamera::info(const geometry::SE3& T_ned_camera) const {
  CameraInfo info;
  info.pose = to_airsim(T_ned_camera);
  info.fov = static_cast<float>(fov_deg());
  const double scale = 1.0 / std::tan(0.5 * radians(fov_deg()));
  const double longer = std::max(width(0), height(0));
  auto& m = info.proj_mat.matrix;
  m[0][1] = static_cast<float>(scale * longer / width(0));
  m[1][2] = static_cast<float>(-scale * longer / height(0));
  m[2][3] = static_cast<float>(kNearPlane_cm);
  m[3][0] = -1.0F;
  return info;
}

double SimCamera::pixels_per_rad() const {
  if (pixels_per_rad_ > 0.0) return pixels_per_rad_;
  for (int type = 0; type < kImageTypeCount; ++type)
    pixels_per_rad_ = std::max(pixels_per_rad_, tileset::view_cone_of(lens(type)).pixels_per_rad);
  return pixels_per_rad_;
}

}  // namespace tileflight::simulator
