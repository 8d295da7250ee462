#include "tileflight/evaluation/localization/picture_localizer.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
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
  std::optional<render::CameraRenderer> renderer;
  keyframes::LensPyramid lens;
  keyframes::SelectionOptions selection;
  keyframes::TrackingOptions tracking = tracking_options();

  Impl(const scene::Scene& scene, std::shared_ptr<const render::Appearance> appearance, const imaging::Camera& full,
       const LocalizerOptions& o)
      : camera(shrink_camera(full, o.width)), full_width(full.width()), full_height(full.height()), options(o) {
    renderer.emplace(scene, std::move(appearance), camera, render::RenderOptions{});
    keyframes::OdometryOptions pyramid;
    pyramid.min_level_area_px = 500;  // coarser levels than for video, since the guess is farther off than the previous
                                      // image would be
    lens = keyframes::build_lens_pyramid(camera, keyframes::pyramid_levels(camera.width(), camera.height(), pyramid));
  }

  FloatImage make_luma(const RgbImage& image) const {
    return imaging::downsample(keyframes::luminance(image, nullptr), camera.width(), camera.height());
  }
  keyframes::Pyramid make_pyramid(const FloatImage& luma, double window) const {
    const int reach = std::max(4, static_cast<int>(0.5 * window * camera.width()));
    return keyframes::build_pyramid(normalize_local_contrast(luma, reach), static_cast<int>(lens.lenses.size()));
  }
  std::shared_ptr<const RenderedView> render_view(const SE3& T_local_camera, double window) const;
  /// Repeats rendering and alignment until the pose stays, at most `rounds` times.
  std::optional<LocalizationResult> approach(const FloatImage& seen, const SE3& guess, double window, int rounds) const;

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

  /// Reads an image. Throws InputError if it differs in size from the camera.
  FloatImage read(const RgbImage& picture) const;
  /// Aligns an image with a view, whatever the quality of the result; nullopt: the alignment did not converge.
  std::optional<LocalizationResult> align(const keyframes::Pyramid& seen, const RenderedView& view,
                                          const SE3& guess) const;
  bool matches(const LocalizationResult& located) const {
    return located.share_in_view >= options.min_share_in_view && located.correlation >= options.min_correlation;
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

void PictureLocalizer::use(const scene::Scene& scene, std::shared_ptr<const render::Appearance> appearance) {
  impl_->renderer.emplace(scene, std::move(appearance), impl_->camera, render::RenderOptions{});
}

std::shared_ptr<const render::Appearance> PictureLocalizer::appearance() const { return impl_->renderer->appearance(); }

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

/// Holds sums over the points that lie in one cell of a grid over the image.
struct CellSum {
  Eigen::Matrix<double, 8, 1> gradient = Eigen::Matrix<double, 8, 1>::Zero();
  geometry::Vec3 points = geometry::Vec3::Zero();  ///< in the image's camera frame
  double count = 0.0;
};

/// Returns what the parts of the image contributed to the pose. Their squares sum up to the covariance by the sandwich
/// of sums over clusters of pixels (Liang, Zeger, Biometrika 73, 1986): residuals are independent between the cells of
/// a grid over the image, and of any correlation within one.
std::vector<registration::PosePart> image_parts(const keyframes::Lens& lens, const tracking::ReferenceLevel& reference,
                                                const keyframes::PyramidLevel& picture,
                                                const tracking::ImageAlignment& alignment,
                                                const keyframes::TrackingOptions& tracking, const SE3& T_local_view) {
  using Vec8 = Eigen::Matrix<double, 8, 1>;
  using Mat8 = Eigen::Matrix<double, 8, 8>;
  constexpr int kColumns = 6, kRows = 4, kFewest = 12;  // cells; at least four more than unknowns
  std::array<CellSum, kColumns * kRows> sums;
  Mat8 normal = Mat8::Zero();
  const SE3& T = alignment.state.T_target_reference;
  const Eigen::Matrix3d R = T.rotation.toRotationMatrix();
  const double gain = std::exp(alignment.state.a);
  for (std::size_t i = 0; i < reference.size(); ++i) {
    const geometry::Vec3 X = R * reference.ray_of(i).cast<double>() + reference.rho[i] * T.translation;
    geometry::Vec2 pixel;
    Eigen::Matrix<double, 2, 3> by_X;
    if (!lens.project<double>(X, pixel, by_X)) continue;
    if (!picture.inside(static_cast<float>(pixel.x()), static_cast<float>(pixel.y()), 2.0F)) continue;
    const keyframes::Texel texel = picture.sample(static_cast<float>(pixel.x()), static_cast<float>(pixel.y()));
    const double predicted = gain * reference.intensity[i];
    const double residual = texel[keyframes::kIntensity] - predicted - alignment.state.b, size = std::abs(residual);
    if (size > tracking.cutoff) continue;
    const double weight = size > tracking.huber ? tracking.huber / size : 1.0;
    const geometry::Vec3 gradient =
        by_X.transpose() * geometry::Vec2(texel[keyframes::kGradX], texel[keyframes::kGradY]);
    Vec8 row;
    row << reference.rho[i] * gradient, X.cross(gradient), -predicted, -1.0;
    normal += weight * row * row.transpose();
    const int column = std::min(kColumns - 1, static_cast<int>(kColumns * pixel.x() / picture.width));
    const int line = std::min(kRows - 1, static_cast<int>(kRows * pixel.y() / picture.height));
    const auto cell = static_cast<std::size_t>(line) * kColumns + static_cast<std::size_t>(column);
    sums[cell].gradient += weight * residual * row;
    sums[cell].points += X / reference.rho[i];
    sums[cell].count += 1.0;
  }
  const auto cells = static_cast<double>(std::ranges::count_if(sums, [](const CellSum& s) { return s.count > 0.0; }));
  const Vec8 scale = (normal.diagonal().array() + 1e-30).sqrt().inverse();
  Mat8 scaled = scale.asDiagonal() * normal * scale.asDiagonal();
  scaled.diagonal().array() += 1e-9;
  const Mat8 inverse = scale.asDiagonal() * scaled.inverse() * scale.asDiagonal();
  constexpr double kUnknowns = 8.0;
  // Few cells fit their own errors; fewer than kFewest tell nothing, and the covariance becomes large.
  const double correction = cells >= kFewest ? cells / (cells - kUnknowns) : 100.0;
  const SE3 T_local_camera = T_local_view * T.inverse();
  std::vector<registration::PosePart> parts;
  for (const CellSum& sum : sums) {
    if (sum.count == 0.0) continue;
    const geometry::Vec3 middle = sum.points / sum.count;
    // The pose moves by minus the increment that the residuals ask for, which acts on the points in the camera's frame:
    // the camera's own motion is its inverse.
    parts.push_back({T_local_camera * middle, middle.norm() * picture.width / (kColumns * lens.focal_px()),
                     std::sqrt(correction) * (inverse * sum.gradient).head<6>()});
  }
  return parts;
}

Mat6 covariance_by_parts(const std::vector<registration::PosePart>& parts) {
  Mat6 covariance = Mat6::Zero();
  for (const registration::PosePart& part : parts) covariance += part.motion * part.motion.transpose();
  return covariance;
}

/// Covariance of what image and rendering differ in by their sampling alone, which parts of the image share.
Mat6 sampling_covariance(const keyframes::Lens& lens, const tracking::ReferenceLevel& reference) {
  constexpr double kShift_px = 0.03;
  double rho = 0.0;
  for (std::size_t i = 0; i < reference.size(); ++i) rho += reference.rho[i] / static_cast<double>(reference.size());
  const double sigma_rad = kShift_px / lens.focal_px(), sigma_m = sigma_rad / std::max(1e-6, rho);
  geometry::Vec6 variances;
  variances << geometry::Vec3::Constant(sigma_m * sigma_m), geometry::Vec3::Constant(sigma_rad * sigma_rad);
  return variances.asDiagonal();
}

}  // namespace

std::shared_ptr<const RenderedView> PictureLocalizer::Impl::render_view(const SE3& T_local_camera,
                                                                        double window) const {
  const render::RenderedFrame predicted = renderer->render(T_local_camera);
  const keyframes::Pyramid expected = make_pyramid(make_luma(predicted.rgb), window);
  const std::vector<tracking::ReferencePoint> points = select_points(expected, predicted.depth_m);
  constexpr std::size_t kFewest = 50;
  if (points.size() < kFewest) return nullptr;
  return std::make_shared<RenderedView>(
      RenderedView{T_local_camera, tracking::make_tracking_reference(lens, expected, points), window});
}

std::shared_ptr<const RenderedView> PictureLocalizer::render_view(const SE3& T_local_camera, double window) const {
  return impl_->render_view(T_local_camera, window);
}

const LocalizerOptions& PictureLocalizer::options() const { return impl_->options; }

double PictureLocalizer::image_motion(const RenderedView& view, const SE3& T_local_from, const SE3& T_local_to) const {
  // The points' distances from the view are nearly those from a pose near it.
  const SE3 T_to_from = T_local_to.inverse() * T_local_from;
  return tracking::optical_flow(impl_->lens, view.reference, T_to_from).full_px / impl_->camera.width();
}

std::optional<LocalizationResult> PictureLocalizer::Impl::align(const keyframes::Pyramid& seen,
                                                                const RenderedView& view, const SE3& guess) const {
  const tracking::ImageAlignmentState start{.T_target_reference = guess.inverse() * view.T_local_camera};
  const tracking::ImageAlignment alignment = tracking::align_image(lens, view.reference, seen, start, tracking);
  if (!alignment.converged) return std::nullopt;
  const SE3& T_picture_view = alignment.state.T_target_reference;
  const tracking::ReferenceLevel& finest = view.reference.levels[0];
  LocalizationResult located{.T_local_camera = view.T_local_camera * T_picture_view.inverse(),
                             .information = pose_information(alignment),
                             .correlation = correlation(finest, seen.levels[0], T_picture_view),
                             .share_in_view = alignment.inside_share,
                             .rmse = alignment.finest_rmse()};
  located.parts = image_parts(lens.lenses[0], finest, seen.levels[0], alignment, tracking, view.T_local_camera);
  located.covariance = covariance_by_parts(located.parts) + sampling_covariance(lens.lenses[0], finest);
  return located;
}

FloatImage PictureLocalizer::Impl::read(const RgbImage& picture) const {
  if (picture.width != full_width || picture.height != full_height)
    throw InputError("image", "is " + std::to_string(picture.width) + "x" + std::to_string(picture.height) +
                                  ", the calibration is for " + std::to_string(full_width) + "x" +
                                  std::to_string(full_height));
  return make_luma(picture);
}

std::optional<LocalizationResult> PictureLocalizer::Impl::approach(const FloatImage& seen, const SE3& guess,
                                                                   double window, int rounds) const {
  const keyframes::Pyramid pyramid = make_pyramid(seen, window);
  LocalizationResult located{.T_local_camera = guess};
  for (int round = 0; round < rounds; ++round) {
    const auto view = render_view(located.T_local_camera, window);
    if (!view) return std::nullopt;
    const auto next = align(pyramid, *view, located.T_local_camera);
    if (!next) return std::nullopt;
    located = *next;
    constexpr double kStill_px = 0.05;
    const SE3 T_picture_view = located.T_local_camera.inverse() * view->T_local_camera;
    if (tracking::optical_flow(lens, view->reference, T_picture_view).full_px < kStill_px) break;
  }
  return matches(located) ? std::optional(located) : std::nullopt;
}

std::optional<LocalizationResult> PictureLocalizer::align(const RgbImage& picture, const RenderedView& view,
                                                          const SE3& guess) const {
  const keyframes::Pyramid seen = impl_->make_pyramid(impl_->read(picture), view.window);
  const auto located = impl_->align(seen, view, guess);
  return located && impl_->matches(*located) ? located : std::nullopt;
}

std::optional<LocalizationResult> PictureLocalizer::locate(const RgbImage& picture, const SE3& guess) const {
  const FloatImage seen = impl_->read(picture);
  const LocalizerOptions& options = impl_->options;
  const auto found = impl_->approach(seen, guess, options.wide_window, options.max_rounds);
  if (!found || options.narrow_window >= options.wide_window) return found;
  constexpr int kNarrowRounds = 2;
  auto refined = impl_->approach(seen, found->T_local_camera, options.narrow_window, kNarrowRounds);
  if (!refined) return found;
  refined->correlation = found->correlation;
  return refined;
}

}  // namespace tileflight::localization
