#include "tileflight/slam/odometry/stereo_input.h"

#include <tbb/parallel_for.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <cstdlib>
#include <utility>
#include <vector>

#include "tileflight/core/base/input_error.h"
#include "tileflight/slam/initialization/klt.h"

namespace tileflight::odometry {

namespace {

using geometry::Mat3;
using geometry::Vec3;

/// Unit rays of a corner in both cameras, in the axes of the reference camera.
struct RayMatch {
  Vec3 own, other;
};

/// Returns the other camera's image as the reference camera would see it if all were infinitely far away; black where
/// it saw nothing.
keyframes::Pyramid turned_picture(const keyframes::LensPyramid& lens, const keyframes::Pyramid& own,
                                  const keyframes::StereoCamera& camera, const keyframes::PyramidLevel& other) {
  const keyframes::PyramidLevel& level = own.levels[0];
  imaging::FloatImage image = keyframes::make_image_in({}, level.width, level.height);
  const Eigen::Matrix3f R = camera.T_stereo_reference.rotation.toRotationMatrix().cast<float>();
  tbb::parallel_for(0, level.height, [&](int y) {
    for (int x = 0; x < level.width; ++x) {
      const Eigen::Vector3f& ray = lens.rays[0].at(x, y);
      Eigen::Vector2f pixel;
      const bool seen =
          !ray.isZero(0) && camera.lens.project<float>(R * ray, pixel) && other.inside(pixel.x(), pixel.y(), 0.0F);
      image(x, y) = seen ? other.sample_intensity(pixel.x(), pixel.y()) : 0.0F;
    }
  });
  return keyframes::build_pyramid(std::move(image), static_cast<int>(own.levels.size()));
}

/// Distance of a turned ray from its epipolar plane, radians; 0 along the baseline, where there is no plane.
double plane_distance(const RayMatch& match, const Vec3& turned, const Vec3& baseline, Vec3& normal) {
  normal = match.own.cross(baseline);
  const double sine = normal.norm();
  if (sine < 0.05) return normal.setZero(), 0.0;
  normal /= sine;
  return turned.dot(normal);
}

Vec3 fit_rotation_to_planes(const std::vector<RayMatch>& matches, const Vec3& baseline, double sigma_rad) {
  constexpr int kIterations = 12;
  constexpr double kPriorSigma_rad = 0.2;  // keeps what a narrow view does not determine near zero
  Vec3 w = Vec3::Zero();
  for (int i = 0; i < kIterations; ++i) {
    const Eigen::Quaterniond turn = geometry::so3_exp(w);
    Mat3 H = Mat3::Identity() / (kPriorSigma_rad * kPriorSigma_rad);
    Vec3 g = H * w;
    for (const RayMatch& match : matches) {
      const Vec3 turned = turn * match.other;
      Vec3 normal;
      const double e = plane_distance(match, turned, baseline, normal) / sigma_rad;
      const double weight = 1.0 / (1.0 + e * e);        // Cauchy
      const Vec3 J = turned.cross(normal) / sigma_rad;  // (d x b) . n = d . (b x n)
      H += weight * J * J.transpose();
      g += weight * J * e;
    }
    const Vec3 step = -H.ldlt().solve(g);
    w = geometry::so3_log(geometry::so3_exp(step) * turn);
    if (step.norm() < 1e-7) break;
  }
  return w;
}

}  // namespace

std::vector<std::optional<Vec3>> find_in_other_camera(const keyframes::LensPyramid& lens, const keyframes::Pyramid& own,
                                                      const keyframes::StereoCamera& camera,
                                                      const keyframes::PyramidLevel& other,
                                                      const std::vector<Eigen::Vector2f>& corners) {
  const auto found = initialization::track_corners(own, turned_picture(lens, own, camera, other), corners);
  std::vector<std::optional<Vec3>> rays(corners.size());
  for (std::size_t i = 0; i < corners.size(); ++i)
    if (found[i]) rays[i] = lens.lenses[0].unproject(found[i]->cast<double>());
  return rays;
}

std::optional<RigFit> check_rig(const keyframes::LensPyramid& lens, const keyframes::Pyramid& own,
                                const keyframes::StereoCamera& camera, const keyframes::PyramidLevel& other) {
  constexpr std::size_t kFewest = 40;
  constexpr double kFits_px = 1.5, kLeastShare = 0.5, kClearParallax_px = 1.5, kVisible_px = 0.6;
  constexpr int kCorners = 400;
  const std::vector<Eigen::Vector2f> corners = initialization::find_corners(own, lens.rays[0], kCorners);
  const auto found = find_in_other_camera(lens, own, camera, other, corners);
  std::vector<RayMatch> matches;
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const auto ray = lens.lenses[0].unproject(corners[i].cast<double>());
    if (ray && found[i]) matches.push_back({*ray, *found[i]});
  }
  if (matches.size() < kFewest) return std::nullopt;
  const double pixel_rad = 1.0 / lens.lenses[0].focal_px();
  // X = a + rho c is the direction of a point from the other camera, in the reference camera's axes.
  const geometry::SE3& T = camera.T_stereo_reference;
  const Vec3 baseline = (T.rotation.conjugate() * T.translation).normalized();
  const Vec3 w = fit_rotation_to_planes(matches, baseline, 0.5 * pixel_rad);
  const Eigen::Quaterniond turn = geometry::so3_exp(w);
  RigFit fit{.rotation_rad = w.norm()};
  double as_given = 0.0;  // sum of squared distances without the rotation
  int before = 0, behind = 0;
  for (const RayMatch& match : matches) {
    const Vec3 turned = turn * match.other;
    Vec3 normal;
    if (std::abs(plane_distance(match, turned, baseline, normal)) > kFits_px * pixel_rad) continue;
    ++fit.matches;
    const double distance = plane_distance(match, match.other, baseline, normal);
    as_given += distance * distance;
    const Vec3 towards = baseline - match.own * match.own.dot(baseline);
    const double parallax_rad = turned.dot(towards) / std::max(towards.norm(), 1e-3);
    before += parallax_rad > kClearParallax_px * pixel_rad;
    behind += parallax_rad < -kClearParallax_px * pixel_rad;
  }
  if (fit.matches < kLeastShare * static_cast<double>(matches.size())) return std::nullopt;
  // A turn that the view hardly shows follows the corners' own errors, a few tenths of a pixel.
  if (as_given < fit.matches * kVisible_px * kVisible_px * pixel_rad * pixel_rad) fit.rotation_rad = 0.0;
  if (before + behind > 0) fit.behind_share = static_cast<double>(behind) / (before + behind);
  return fit;
}

namespace {

std::string camera_text(const OtherCamera& camera) {
  return camera.name.empty() ? "another camera of the rig" : "camera " + camera.name;
}

void require_stereo_camera(const OtherCamera& camera) {
  const imaging::Calibration& calibration = camera.calibration;
  if (calibration.camera.width() <= 0 || calibration.camera.height() <= 0)
    throw InputError(camera_text(camera), "its calibration has no image size; give the width and height of the images");
  if (calibration.line_delay_s != 0.0)
    throw InputError(camera_text(camera),
                     "has a rolling shutter (line_delay), which static stereo does not correct; use one camera alone");
  const geometry::Vec3& t = camera.T_other_reference.translation;
  if (!t.allFinite() || !camera.T_other_reference.rotation.coeffs().allFinite())
    throw InputError(camera_text(camera), "its pose on the rig is not finite");
  if (t.norm() < 1e-4)
    throw InputError(
        camera_text(camera),
        "is where the reference camera is (less than 0.1 mm away), so that it shows no distances; give the "
        "poses of the rig's cameras");
}

keyframes::StereoPicture make_picture(bool known, double log_exposure_ratio) {
  keyframes::StereoPicture picture;
  picture.brightness_prior.a = picture.brightness_linear.a = log_exposure_ratio;
  // The weights are those of a keyframe's own brightness (tracking_state.cpp): nearly known, or free.
  picture.brightness_information = known ? Eigen::Vector2d(1e10, 1e6) : Eigen::Vector2d(1e3, 1.0);
  return picture;
}

}  // namespace

bool is_blind(const imaging::RgbImage& picture) {
  constexpr int kStride = 4, kVisible = 8;  // grey values, between neighbours; more than a camera's noise in the dark
  constexpr double kLeastShare = 1e-3;
  const auto grey = [&](int x, int y) {
    const imaging::Rgb8& p = picture(x, y);
    return (p[0] + 2 * p[1] + p[2]) / 4;
  };
  int seen = 0, visible = 0;
  for (int y = 2; y + 2 < picture.height; y += kStride) {
    for (int x = 2; x + 2 < picture.width; x += kStride, ++seen)
      visible +=
          std::abs(grey(x + 2, y) - grey(x - 2, y)) > kVisible || std::abs(grey(x, y + 2) - grey(x, y - 2)) > kVisible;
  }
  return visible <= kLeastShare * seen;
}

StereoInput::StereoInput(std::vector<OtherCamera> cameras) : cameras_(std::move(cameras)) {
  if (cameras_.size() > keyframes::kMaxStereoCameras)
    throw InputError("odometry", std::to_string(cameras_.size()) +
                                     " cameras are given besides the reference camera; at most " +
                                     std::to_string(keyframes::kMaxStereoCameras) + " can be used");
  for (const OtherCamera& camera : cameras_) require_stereo_camera(camera);
}

std::vector<keyframes::StereoCamera> StereoInput::stereo_cameras() const {
  std::vector<keyframes::StereoCamera> cameras;
  for (const OtherCamera& camera : cameras_)
    cameras.push_back({keyframes::Lens(camera.calibration.camera), camera.T_other_reference});
  return cameras;
}

void StereoInput::require_usable(const InputFrame& frame) const {
  const std::string where = "frame " + std::to_string(frame.index);
  if (frame.others.size() > cameras_.size())
    throw InputError(where, "has images of " + std::to_string(frame.others.size()) + " other cameras, the rig has " +
                                std::to_string(cameras_.size()));
  for (std::size_t c = 0; c < frame.others.size(); ++c) {
    const imaging::RgbImage& image = frame.others[c].image;
    const imaging::Camera& camera = cameras_[c].calibration.camera;
    if (image.empty() || (image.width == camera.width() && image.height == camera.height())) continue;
    throw InputError(where, camera_text(cameras_[c]) + ": its image is " + std::to_string(image.width) + "x" +
                                std::to_string(image.height) + ", its calibration is for " +
                                std::to_string(camera.width()) + "x" + std::to_string(camera.height()));
  }
}

std::vector<keyframes::StereoPicture> StereoInput::pictures(const InputFrame& frame, bool has_photometric) {
  std::vector<keyframes::StereoPicture> pictures;
  for (std::size_t c = 0; c < cameras_.size(); ++c) {
    const bool taken = c < frame.others.size() && !frame.others[c].image.empty() && !is_blind(frame.others[c].image);
    const auto& photometric = cameras_[c].photometric;
    const bool known =
        taken && has_photometric && photometric && frame.exposure_ms > 0.0 && frame.others[c].exposure_ms > 0.0;
    pictures.push_back(make_picture(known, known ? std::log(frame.others[c].exposure_ms / frame.exposure_ms) : 0.0));
    if (taken)
      pictures.back().pyramid = pyramids_.make(frame.others[c].image, photometric ? &*photometric : nullptr, 1);
  }
  return pictures;
}

}  // namespace tileflight::odometry
