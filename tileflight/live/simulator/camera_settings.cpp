#include "tileflight/live/simulator/camera_settings.h"

#include <cmath>
#include <utility>

#include "tileflight/core/base/input_error.h"
#include "tileflight/live/simulator/frames.h"

namespace tileflight::simulator {
namespace {

using base::StrictSection;
using geometry::SE3;
using geometry::Vec3;
using imaging::Camera;

constexpr int kMaxSide_px = 8192;
constexpr double kMaxImagePixels = 32e6;

LensDescription read_lens(StrictSection section, const CaptureSettings& capture) {
  LensDescription lens;
  lens.model =
      section.choice_in_any_case("Model", {"pinhole", "fisheye", "kannala-brandt", "panorama"}).value_or("fisheye");
  if (lens.model == "kannala-brandt") lens.model = "fisheye";
  lens.width = capture.width;
  lens.height = capture.height;
  lens.fov_degrees = static_cast<float>(section.number("FOV_Degrees", 0.0, 0.0, 360.0));
  for (const double k : section.numbers("K", 0, 4).value_or(std::vector<double>{}))
    lens.k.push_back(static_cast<float>(k));
  for (const double value : section.numbers("Intrinsics", 0, 4).value_or(std::vector<double>{}))
    lens.intrinsics.push_back(static_cast<float>(value));
  section.require_all_keys_used();
  return lens;
}

void read_capture(StrictSection& section, CaptureSettings& capture) {
  capture.width = section.integer("Width", capture.width, 1, kMaxSide_px);
  capture.height = section.integer("Height", capture.height, 1, kMaxSide_px);
  capture.fov_deg = section.number("FOV_Degrees", capture.fov_deg, 0.1, 179.9);
  if (auto lens = section.section("Lens")) capture.lens = read_lens(std::move(*lens), capture);
  if (section.text("ProjectionMode").value_or("perspective") == "orthographic")
    throw section.error("ProjectionMode", "orthographic images are not supported: use perspective");
  make_lens(capture, section.place());
  section.ignore({"ImageType", "AutoExposureSpeed", "AutoExposureBias", "AutoExposureMaxBrightness",
                  "AutoExposureMinBrightness", "AutoExposureLowPercent", "AutoExposureHighPercent",
                  "AutoExposureHistogramLogMin", "AutoExposureHistogramLogMax", "AutoExposureMethod",
                  "MotionBlurAmount", "MotionBlurMax", "TargetGamma", "OrthoWidth", "LumenGIEnable",
                  "LumenReflectionEnable", "ChromaticAberrationScale"});
  section.require_all_keys_used();
}

double focal_px(const CaptureSettings& capture) {
  return 0.5 * std::max(capture.width, capture.height) / std::tan(0.5 * radians(capture.fov_deg));
}

Camera make_fisheye_lens(const LensDescription& lens, int width, int height, const std::string& where) {
  std::array<double, 4> k{};
  for (std::size_t i = 0; i < lens.k.size(); ++i) k[i] = lens.k[i];
  if (lens.intrinsics.empty()) {
    const double fov_deg = lens.fov_degrees > 0.0F ? lens.fov_degrees : 180.0;
    return imaging::make_fisheye(width, height, fov_deg, k);
  }
  const auto& i = lens.intrinsics;
  base::require(i.size() == 4 && i[0] > 0.0F && i[1] > 0.0F, where,
                "the intrinsics must be fx, fy, cx, cy, with fx and fy above 0");
  return {imaging::KannalaBrandt{i[0], i[1], i[2] - 0.5, i[3] - 0.5, k}, width, height};
}

Camera make_pinhole_lens(const LensDescription& lens, int width, int height, const std::string& where) {
  if (lens.intrinsics.empty())
    return imaging::make_pinhole(width, height, lens.fov_degrees > 0.0F ? lens.fov_degrees : 90.0);
  const auto& i = lens.intrinsics;
  base::require(i.size() == 4 && i[0] > 0.0F && i[1] > 0.0F, where,
                "the intrinsics must be fx, fy, cx, cy, with fx and fy above 0");
  return {imaging::PinholeRadtan{i[0], i[1], i[2] - 0.5, i[3] - 0.5, {}}, width, height};
}

void check(const LensDescription& lens, const std::string& where) {
  base::require(lens.k.size() <= 4, where, "a fisheye lens has at most four coefficients");
  for (const float value : lens.k)
    base::require(std::isfinite(value) && std::abs(value) < 1e3F, where, "a coefficient is out of range");
  for (const float value : lens.intrinsics)
    base::require(std::isfinite(value) && std::abs(value) < 1e6F, where, "the intrinsics are out of range");
  base::require(std::isfinite(lens.fov_degrees) && lens.fov_degrees >= 0.0F && lens.fov_degrees <= 360.0F, where,
                "the field of view is out of range");
}

SE3 offset(double x, double y, double pitch_deg, double yaw_deg) {
  return {rotation_from_rpy(0, radians(pitch_deg), radians(yaw_deg)), Vec3(x, y, 0.0)};
}

}  // namespace

Vec3 read_position(StrictSection& section, const Vec3& fallback) {
  constexpr double kFar_m = 1e7;
  const auto along = [&](const char* key, double value) { return section.number(key, value, -kFar_m, kFar_m); };
  return {along("X", fallback.x()), along("Y", fallback.y()), along("Z", fallback.z())};
}

Eigen::Quaterniond read_orientation(StrictSection& section) {
  const auto angle = [&](const char* key) { return radians(section.number(key, 0.0, -3600.0, 3600.0)); };
  const double roll = angle("Roll"), pitch = angle("Pitch");
  return rotation_from_rpy(roll, pitch, angle("Yaw"));
}

Camera make_lens(const CaptureSettings& capture, const std::string& where) {
  const int width = capture.width, height = capture.height;
  base::require(width >= 1 && height >= 1 && width <= kMaxSide_px && height <= kMaxSide_px &&
                    static_cast<double>(width) * height <= kMaxImagePixels,
                where, "an image must not exceed 8192 x 8192 or 32 million pixels");
  if (capture.lens) {
    check(*capture.lens, where);
    if (capture.lens->model == "panorama") return imaging::make_panorama(width, height);
    if (capture.lens->model == "pinhole") return make_pinhole_lens(*capture.lens, width, height, where);
    base::require(capture.lens->model == "fisheye", where,
                  "the lens '" + capture.lens->model + "' is unknown; use pinhole, fisheye or panorama");
    return make_fisheye_lens(*capture.lens, width, height, where);
  }
  base::require(capture.fov_deg >= 0.1 && capture.fov_deg <= 179.9, where,
                "the field of view must be from 0.1 to 179.9 degrees");
  const double f = focal_px(capture);
  return {imaging::PinholeRadtan{f, f, 0.5 * (width - 1), 0.5 * (height - 1), {}}, width, height};
}

CameraSettings read_camera(const std::string& name, StrictSection section, const CameraSettings& defaults) {
  CameraSettings camera = defaults;
  camera.name = name;
  camera.T_body_camera = SE3(read_orientation(section), read_position(section));
  for (StrictSection& entry : section.sections("CaptureSettings")) {
    const int type = entry.integer("ImageType", 0, -1, 100);
    CaptureSettings unused;
    read_capture(entry, type >= 0 && type < kImageTypeCount ? camera.captures[static_cast<std::size_t>(type)] : unused);
  }
  section.ignore({"NoiseSettings", "Gimbal", "UnrealEngine"});
  section.require_all_keys_used();
  return camera;
}

std::vector<CameraSettings> default_cameras(const CameraSettings& defaults) {
  const std::vector<std::pair<std::string, SE3>> places{{"front_center", offset(0, 0, 0, 0)},
                                                        {"front_right", offset(0, 0.125, 0, 0)},
                                                        {"front_left", offset(0, -0.125, 0, 0)},
                                                        {"bottom_center", offset(0, 0, -90, 0)},
                                                        {"back_center", offset(0, 0, 0, 180)}};
  std::vector<CameraSettings> cameras;
  for (const auto& [name, T_body_camera] : places) {
    cameras.push_back(defaults);
    cameras.back().name = name;
    cameras.back().T_body_camera = T_body_camera;
  }
  return cameras;
}

std::string resolve_camera_alias(const std::string& name) {
  static const std::vector<std::pair<std::string, std::string>> kAliases{
      {"", "front_center"}, {"fpv", "front_center"}, {"0", "front_center"}, {"1", "front_right"},
      {"2", "front_left"},  {"3", "bottom_center"},  {"4", "back_center"}};
  for (const auto& [alias, camera] : kAliases) {
    if (alias == name) return camera;
  }
  return name;
}

}  // namespace tileflight::simulator
