#include "tileflight/evaluation/localization/picture_localizer.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "tileflight/capture/render/appearance.h"
#include "tileflight/capture/render/camera_renderer.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/imaging/summed_area_table.h"
#include "tileflight/slam/keyframes/pixel_selector.h"
#include "tileflight/slam/keyframes/pyramid.h"
#include "tileflight/slam/tracking/tracker.h"

namespace tileflight::localization {

imaging::FloatImage normalize_local_contrast(const imaging::FloatImage& image, int reach, float least_deviation) {
  constexpr double kMean = 128.0, kDeviation = 40.0;
  const auto value = [&](int x, int y) { return static_cast<double>(image(x, y)); };
  const imaging::SummedAreaTable<double> sums(image.width, image.height, value);
  const imaging::SummedAreaTable<double> squares(image.width, image.height,
                                                 [&](int x, int y) { return value(x, y) * value(x, y); });
  imaging::FloatImage result(image.width, image.height);
  for (int y = 0; y < image.height; ++y) {
    const int y0 = std::max(0, y - reach), y1 = std::min(image.height, y + reach + 1);
    for (int x = 0; x < image.width; ++x) {
      const int x0 = std::max(0, x - reach), x1 = std::min(image.width, x + reach + 1);
      const double n = static_cast<double>(x1 - x0) * (y1 - y0);
      const double mean = sums.sum(x0, y0, x1, y1) / n;
      const double variance = std::max(0.0, squares.sum(x0, y0, x1, y1) / n - mean * mean);
      result(x, y) =
          static_cast<float>(kMean + kDeviation * (image(x, y) - mean) / (std::sqrt(variance) + least_deviation));
    }
  }
  return result;
}

using geometry::SE3;
using imaging::FloatImage;
using imaging::RgbImage;

namespace {

keyframes::TrackingOptions tracking_options() {
  keyframes::TrackingOptions options;
  options.huber = 15.0F;  // normalised grey values; an image and a rendering differ more than two images of a video.
                          // Chosen by hand
  options.cutoff = 60.0F;
  options.lost_rmse = 60.0;
  options.max_log_gain = 2.0;
  return options;
}

/// Camera for images downscaled to at most `width` pixels.
imaging::Camera shrink_camera(const imaging::Camera& full, int width) {
  if (full.width() <= width) return full;
  const double share = static_cast<double>(width) / full.width();
  return full.scaled_to(width, std::max(1, static_cast<int>(std::lround(share * full.height()))));
}

/// Whether the surface is smooth around a pixel; at depth edges grey values of both sides mix.
bool is_smooth(const FloatImage& depth_m, int x, int y) {
  constexpr float kStep = 0.05F;
  const float here = depth_m(x, y);
  if (!std::isfinite(here)) return false;
  for (int dy = -1; dy <= 1; ++dy)
    for (int dx = -1; dx <= 1; ++dx)
      if (!(std::abs(depth_m(x + dx, y + dy) - here) < kStep * std::abs(here))) return false;
  return true;
}

}  // namespace

struct PictureLocalizer::Impl {
  imaging::Camera camera;  ///< of the downscaled images
  int full_width = 0, full_height = 0;
  LocalizerOptions options;
  render::CameraRenderer renderer;
  keyframes::LensPyramid lens;
  keyframes::SelectionOptions selection;
  keyframes::TrackingOptions tracking = tracking_options();

  Impl(const scene::Scene& scene, std::shared_ptr<const render::Appearance> appearance, const imaging::Camera& full,
       const LocalizerOptions& o)
      : camera(shrink_camera(full, o.width)),
        full_width(full.width()),
        full_height(full.height()),
        options(o),
        renderer(scene, std::move(appearance), camera, {}) {
    keyframes::OdometryOptions pyramid;
    pyramid.min_level_area_px = 500;  // coarser levels than for video, since the guess is farther off than the previous
                                      // image would be
    lens = keyframes::build_lens_pyramid(camera, keyframes::pyramid_levels(camera.width(), camera.height(), pyramid));
  }

  keyframes::Pyramid make_pyramid(const RgbImage& image) const {
    const int reach = std::max(4, static_cast<int>(0.5 * options.contrast_window * camera.width()));
    const FloatImage luma = imaging::downsample(keyframes::luminance(image, nullptr), camera.width(), camera.height());
    return keyframes::build_pyramid(normalize_local_contrast(luma, reach), static_cast<int>(lens.lenses.size()));
  }

  /// High-gradient pixels of the rendered image, with their inverse distances.
  std::vector<tracking::ReferencePoint> select_points(const keyframes::Pyramid& pyramid,
                                                      const FloatImage& depth_m) const {
    constexpr double kGrazing = 0.05;  // smallest cosine of a ray to the optical axis
    std::vector<tracking::ReferencePoint> points;
    for (const keyframes::SelectedPixel& pixel :
         keyframes::select_pixels(pyramid, lens.rays[0], options.points, selection)) {
      if (!is_smooth(depth_m, pixel.x, pixel.y)) continue;
      const Eigen::Vector3f& ray = lens.rays[0].at(pixel.x, pixel.y);
      if (std::abs(ray.z()) < kGrazing) continue;
      const float range_m = depth_m(pixel.x, pixel.y) / ray.z();
      points.push_back(
          {Eigen::Vector2f(static_cast<float>(pixel.x), static_cast<float>(pixel.y)), 1.0F / range_m, 1.0F});
    }
    return points;
  }

  /// Correlation of the reference's grey values with those of the image, at points inside the image.
  double correlation(const tracking::ReferenceLevel& reference, const keyframes::PyramidLevel& picture,
                     const SE3& T_picture_reference) const {
    double n = 0, a = 0, b = 0, aa = 0, bb = 0, ab = 0;
    const Eigen::Matrix3d R = T_picture_reference.rotation.toRotationMatrix();
    for (std::size_t i = 0; i < reference.size(); ++i) {
      const geometry::Vec3 X =
          R * reference.ray_of(i).cast<double>() + reference.rho[i] * T_picture_reference.translation;
      geometry::Vec2 pixel;
      if (!lens.lenses[0].project<double>(X, pixel)) continue;
      if (!picture.inside(static_cast<float>(pixel.x()), static_cast<float>(pixel.y()), 1.0F)) continue;
      const double p = reference.intensity[i];
      const double q = picture.sample_intensity(static_cast<float>(pixel.x()), static_cast<float>(pixel.y()));
      n += 1, a += p, b += q, aa += p * p, bb += q * q, ab += p * q;
    }
    const double spread = (n * aa - a * a) * (n * bb - b * b);
    return n > 10 && spread > 0.0 ? (n * ab - a * b) / std::sqrt(spread) : 0.0;
  }
};

PictureLocalizer::PictureLocalizer(const scene::Scene& scene, const imaging::Camera& camera,
                                   const LocalizerOptions& options)
    : PictureLocalizer(scene, std::make_shared<const render::Appearance>(scene), camera, options) {}

PictureLocalizer::PictureLocalizer(const scene::Scene& scene, std::shared_ptr<const render::Appearance> appearance,
                                   const imaging::Camera& camera, const LocalizerOptions& options)
    : impl_(std::make_unique<Impl>(scene, std::move(appearance), camera, options)) {}

PictureLocalizer::~PictureLocalizer() = default;

std::shared_ptr<const render::Appearance> PictureLocalizer::appearance() const { return impl_->renderer.appearance(); }

namespace {

/// Information of the pose with the two brightness unknowns eliminated. The tracker's increment acts on the reference
/// points from the left, in the image's camera frame; the camera's own motion is its inverse and has the same
/// information.
Mat6 pose_information(const tracking::ImageAlignment& alignment) {
  const Eigen::Matrix<double, 8, 8>& H = alignment.information;
  const Eigen::Matrix2d light = H.bottomRightCorner<2, 2>() + 1e-9 * Eigen::Matrix2d::Identity();
  const Mat6 pose = H.topLeftCorner<6, 6>() - H.topRightCorner<6, 2>() * light.inverse() * H.bottomLeftCorner<2, 6>();
  const double variance = std::max(1.0, alignment.finest_rmse() * alignment.finest_rmse());
  return pose / variance;
}

}  // namespace

std::optional<LocalizationResult> PictureLocalizer::locate(const RgbImage& picture, const SE3& guess) const {
  const Impl& my = *impl_;
  if (picture.width != my.full_width || picture.height != my.full_height)
    throw InputError("image", "is " + std::to_string(picture.width) + "x" + std::to_string(picture.height) +
                                  ", the calibration is for " + std::to_string(my.full_width) + "x" +
                                  std::to_string(my.full_height));
  const keyframes::Pyramid seen = my.make_pyramid(picture);
  LocalizationResult located{.T_local_camera = guess};
  for (int round = 0; round < my.options.max_rounds; ++round) {
    const render::RenderedFrame predicted = my.renderer.render(located.T_local_camera);
    const keyframes::Pyramid expected = my.make_pyramid(predicted.rgb);
    const std::vector<tracking::ReferencePoint> points = my.select_points(expected, predicted.depth_m);
    constexpr std::size_t kFewest = 50;
    if (points.size() < kFewest) return std::nullopt;
    const tracking::TrackingReference reference = tracking::make_tracking_reference(my.lens, expected, points);
    const tracking::ImageAlignment alignment = tracking::align_image(my.lens, reference, seen, {}, my.tracking);
    if (!alignment.converged) return std::nullopt;
    const SE3& T_picture_reference = alignment.state.T_target_reference;
    located.correlation = my.correlation(reference.levels[0], seen.levels[0], T_picture_reference);
    located.T_local_camera = located.T_local_camera * T_picture_reference.inverse();
    located.information = pose_information(alignment);
    located.share_in_view = alignment.inside_share;
    located.rmse = alignment.finest_rmse();
    constexpr double kStill_px = 0.05;
    const auto flow = tracking::optical_flow(my.lens, reference, T_picture_reference);
    if (flow.full_px < kStill_px) break;
  }
  if (located.share_in_view < my.options.min_share_in_view || located.correlation < my.options.min_correlation)
    return std::nullopt;
  return located;
}

}  // namespace tileflight::localization
