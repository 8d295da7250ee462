#include "tileflight/evaluation/localization/flight_mosaic.h"

#include <tbb/parallel_for.h>

#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <utility>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/order_statistics.h"

namespace tileflight::localization {

using geometry::Vec2;
using geometry::Vec3;
using imaging::FloatImage;

namespace {

/// Medians of the cells with enough points; NaN elsewhere.
FloatImage medians(const std::vector<Vec3>& points, const Vec2& low, double cell, int width, int height) {
  constexpr std::size_t kEnough = 3;
  std::vector<std::pair<std::uint32_t, float>> values;  // cell, height
  for (const Vec3& p : points) {
    const double i = std::floor((p.x() - low.x()) / cell), j = std::floor((p.y() - low.y()) / cell);
    if (!(i >= 0.0 && j >= 0.0 && i < width && j < height)) continue;
    values.emplace_back(
        static_cast<std::uint32_t>(j) * static_cast<std::uint32_t>(width) + static_cast<std::uint32_t>(i),
        static_cast<float>(p.z()));
  }
  std::ranges::sort(values);
  FloatImage result(width, height, std::nanf(""));
  for (std::size_t begin = 0; begin < values.size();) {
    std::size_t end = begin;
    while (end < values.size() && values[end].first == values[begin].first) ++end;
    if (end - begin >= kEnough) result.pixels[values[begin].first] = values[begin + (end - begin) / 2].second;
    begin = end;
  }
  return result;
}

float bilinear(const FloatImage& image, double x, double y) {
  x = std::clamp(x, 0.0, image.width - 1.0), y = std::clamp(y, 0.0, image.height - 1.0);
  const int i = static_cast<int>(x), j = static_cast<int>(y);
  const int i1 = std::min(i + 1, image.width - 1), j1 = std::min(j + 1, image.height - 1);
  const auto a = static_cast<float>(x - i), b = static_cast<float>(y - j);
  return (1.0F - b) * ((1.0F - a) * image(i, j) + a * image(i1, j)) +
         b * ((1.0F - a) * image(i, j1) + a * image(i1, j1));
}

}  // namespace

HeightModel::HeightModel(const std::vector<Vec3>& points, const Vec2& low, const Vec2& high) : low_(low) {
  constexpr double kPointsACell = 4.0, kLargest = 256.0;
  const Vec2 size = (high - low).cwiseMax(1e-9);
  cell_ = std::sqrt(size.x() * size.y() * kPointsACell / std::max<double>(1.0, static_cast<double>(points.size())));
  cell_ = std::max(cell_, size.maxCoeff() / kLargest);
  struct Level {
    FloatImage heights;
    double cell;
  };
  std::vector<Level> levels;
  for (double cell = cell_;; cell *= 2.0) {
    const int width = std::max(1, static_cast<int>(std::ceil(size.x() / cell)));
    const int height = std::max(1, static_cast<int>(std::ceil(size.y() / cell)));
    levels.push_back({medians(points, low, cell, width, height), cell});
    if (width == 1 && height == 1) break;
  }
  heights_ = levels.back().heights;
  float& all = heights_.pixels.front();
  if (!std::isfinite(all)) all = points.empty() ? 0.0F : static_cast<float>(points.front().z());
  for (std::size_t k = levels.size() - 1; k-- > 0;) {
    FloatImage filled = levels[k].heights;
    for (int y = 0; y < filled.height; ++y) {
      for (int x = 0; x < filled.width; ++x)
        if (!std::isfinite(filled(x, y))) filled(x, y) = bilinear(heights_, 0.5 * x - 0.25, 0.5 * y - 0.25);
    }
    heights_ = std::move(filled);
  }
  constexpr std::size_t kNear = 2;  // levels
  supported_ = imaging::GrayImage(heights_.width, heights_.height);
  for (std::size_t k = 0; k <= std::min(kNear, levels.size() - 1); ++k) {
    const FloatImage& known = levels[k].heights;
    for (int y = 0; y < supported_.height; ++y) {
      for (int x = 0; x < supported_.width; ++x) {
        const int i = std::min(x >> k, known.width - 1), j = std::min(y >> k, known.height - 1);
        if (std::isfinite(known(i, j))) supported_(x, y) = 255;
      }
    }
  }
}

double HeightModel::at(const Vec2& position) const {
  const Vec2 p = (position - low_) / cell_;
  return bilinear(heights_, p.x() - 0.5, p.y() - 0.5);
}

bool HeightModel::is_supported(const Vec2& position) const {
  const Vec2 p = (position - low_) / cell_;
  if (!(p.x() >= 0.0 && p.y() >= 0.0 && p.x() < supported_.width && p.y() < supported_.height)) return false;
  return supported_(static_cast<int>(p.x()), static_cast<int>(p.y())) != 0;
}

using geometry::Mat3;
using geometry::SE3;
using geometry::Vec2;
using geometry::Vec3;

namespace {

constexpr int kBlock_px = 16;  // block of the mosaic taken from one image

/// An image available for the mosaic.
struct View {
  std::size_t index;  ///< index in FlightPictures
  SE3 T_camera_ground;
  Vec3 center;  ///< ground frame
};

std::vector<View> select_views(const FlightPictures& flight, const Mat3& R_ground_map, std::size_t most) {
  const std::size_t n = std::min(most, flight.T_map_camera.size());
  std::vector<View> views;
  for (std::size_t k = 0; k < n; ++k) {
    const std::size_t index = (2 * k + 1) * flight.T_map_camera.size() / (2 * n);
    const SE3 T_ground_camera = SE3(R_ground_map, Vec3::Zero()) * flight.T_map_camera[index];
    views.push_back({index, T_ground_camera.inverse(), T_ground_camera.translation});
  }
  return views;
}

/// Pixels per map unit on level ground around a point, in the direction of lowest resolution; nullopt if the image does
/// not show the point or sees it at too flat an angle.
std::optional<double> resolution_at(const imaging::Camera& camera, const View& view, const Vec3& point,
                                    double least_cosine) {
  const Vec3 sight = view.center - point;
  if (!(sight.z() > least_cosine * sight.norm())) return std::nullopt;
  Eigen::Matrix<double, 2, 3> d_pixel_d_point;
  const auto pixel = camera.project(view.T_camera_ground * point, d_pixel_d_point);
  constexpr double kMargin_px = 2.0;
  if (!pixel || !(pixel->minCoeff() > kMargin_px) || !(pixel->x() < camera.width() - 1 - kMargin_px) ||
      !(pixel->y() < camera.height() - 1 - kMargin_px))
    return std::nullopt;
  const Eigen::Matrix2d J = d_pixel_d_point * view.T_camera_ground.rotation.toRotationMatrix().leftCols<2>();
  // The smaller singular value of a 2 x 2 matrix.
  const double half = 0.5 * J.squaredNorm(), determinant = J.determinant();
  return std::sqrt(std::max(0.0, half - std::sqrt(std::max(0.0, half * half - determinant * determinant))));
}

/// Whether the line of sight stays above the height model.
bool is_visible(const HeightModel& heights, const View& view, const Vec3& point) {
  const Vec3 sight = view.center - point;
  const double step = 0.75 * heights.cell(), length = sight.head<2>().norm();
  constexpr int kMostSteps = 64;
  const int steps = std::min(kMostSteps, static_cast<int>(length / step));
  for (int k = 2; k <= steps; ++k) {
    const Vec3 here = point + (k * step / length) * sight;
    if (heights.at(here.head<2>()) > here.z() + 0.5 * step) return false;
  }
  return true;
}

struct Extent {
  Vec2 min, max;
  double pixel_size = 0.0;
};

/// Extent of the points visible in some image, and the pixel size their views resolve.
std::optional<Extent> find_extent(const imaging::Camera& camera, const std::vector<View>& views,
                                  const std::vector<Vec3>& points, const MosaicOptions& options) {
  constexpr std::size_t kSome = 3000, kFewest = 20;
  const std::size_t stride = std::max<std::size_t>(1, points.size() / kSome);
  std::vector<double> x, y, sizes;
  for (std::size_t i = 0; i < points.size(); i += stride) {
    double best = 0.0;
    for (const View& view : views)
      best = std::max(best, resolution_at(camera, view, points[i], std::cos(options.max_incidence_rad)).value_or(0.0));
    if (!(best > 0.0)) continue;
    x.push_back(points[i].x()), y.push_back(points[i].y()), sizes.push_back(1.0 / best);
  }
  if (x.size() < kFewest) return std::nullopt;
  constexpr double kRim = 0.01, kBetterPart = 0.3;
  Extent extent{{base::lower_quantile(x, kRim), base::lower_quantile(y, kRim)},
                {base::lower_quantile(x, 1.0 - kRim), base::lower_quantile(y, 1.0 - kRim)}};
  const Vec2 size = extent.max - extent.min;
  extent.pixel_size =
      std::max(base::lower_quantile(sizes, kBetterPart), std::sqrt(size.x() * size.y() / options.max_pixels));
  return extent;
}

GroundImage empty_image(const Extent& extent, const HeightModel& heights) {
  GroundImage image;
  const Vec2 size = (extent.max - extent.min) / extent.pixel_size;
  const auto blocks = [](double pixels) { return std::max(1, static_cast<int>(std::ceil(pixels / kBlock_px))); };
  image.grey = imaging::GrayImage(blocks(size.x()) * kBlock_px, blocks(size.y()) * kBlock_px);
  image.seen = imaging::GrayImage(image.grey.width, image.grey.height);
  image.pixel_size = extent.pixel_size;
  image.origin = Vec2(extent.min.x(), extent.max.y());
  constexpr int kStep = GroundImage::kHeightStep;
  image.height = imaging::FloatImage(image.grey.width / kStep, image.grey.height / kStep, std::nanf(""));
  for (int j = 0; j < image.height.height; ++j) {
    for (int i = 0; i < image.height.width; ++i) {
      const Vec2 position = image.position(kStep * i, kStep * j);
      if (heights.is_supported(position)) image.height(i, j) = static_cast<float>(heights.at(position));
    }
  }
  return image;
}

float bilinear(const imaging::GrayImage& image, double x, double y) {
  const int i = static_cast<int>(x), j = static_cast<int>(y);
  const auto a = static_cast<float>(x - i), b = static_cast<float>(y - j);
  const std::uint8_t* p = image.row(j) + i;
  const std::uint8_t* q = p + image.width;
  const float upper = p[0] + a * static_cast<float>(p[1] - p[0]), lower = q[0] + a * static_cast<float>(q[1] - q[0]);
  return upper + b * (lower - upper);
}

class MosaicBuilder {
 public:
  MosaicBuilder(const FlightPictures& flight, const std::vector<Vec3>& points, std::vector<View> views,
                const Extent& extent, const MosaicOptions& options)
      : flight_(flight),
        views_(std::move(views)),
        options_(options),
        heights_(points, extent.min, extent.max),
        image_(empty_image(extent, heights_)) {}

  GroundImage build() {
    choose_views();
    load_pictures();
    tbb::parallel_for(std::size_t{0}, view_of_block_.size(),
                      [&](std::size_t k) { project_block(static_cast<int>(k)); });
    fill_unseen(image_.grey, image_.seen);
    return std::move(image_);
  }

 private:
  int columns() const { return image_.grey.width / kBlock_px; }
  int rows() const { return image_.grey.height / kBlock_px; }
  Vec3 ground_position(double i, double j) const {
    const Vec2 position = image_.position(i, j);
    return {position.x(), position.y(), heights_.at(position)};
  }

  void choose_views() {
    view_of_block_.assign(static_cast<std::size_t>(columns()) * rows(), -1);
    tbb::parallel_for(std::size_t{0}, view_of_block_.size(), [&](std::size_t k) {
      const int column = static_cast<int>(k) % columns(), row = static_cast<int>(k) / columns();
      const Vec3 middle = ground_position((column + 0.5) * kBlock_px - 0.5, (row + 0.5) * kBlock_px - 0.5);
      if (!heights_.is_supported(middle.head<2>())) return;
      double best = 0.0;
      for (std::size_t v = 0; v < views_.size(); ++v) {
        const auto resolution = resolution_at(flight_.camera, views_[v], middle, std::cos(options_.max_incidence_rad));
        if (!resolution || *resolution <= best || !is_visible(heights_, views_[v], middle)) continue;
        best = *resolution;
        view_of_block_[k] = static_cast<int>(v);
      }
    });
  }

  void load_pictures() {
    pictures_.resize(views_.size());
    tbb::parallel_for(std::size_t{0}, views_.size(), [&](std::size_t v) {
      if (std::ranges::find(view_of_block_, static_cast<int>(v)) == view_of_block_.end()) return;
      const std::optional<imaging::RgbImage> picture = flight_.picture(views_[v].index);
      if (!picture) return;  // its blocks stay empty
      pictures_[v] = imaging::to_gray(*picture);
      if (pictures_[v].width != flight_.camera.width() || pictures_[v].height != flight_.camera.height())
        throw InputError("image " + std::to_string(views_[v].index),
                         "is " + std::to_string(pictures_[v].width) + "x" + std::to_string(pictures_[v].height) +
                             ", the calibration is for " + std::to_string(flight_.camera.width()) + "x" +
                             std::to_string(flight_.camera.height()));
    });
  }

  void project_block(int block) {
    const int v = view_of_block_[static_cast<std::size_t>(block)];
    if (v < 0) return;
    const View& view = views_[static_cast<std::size_t>(v)];
    const imaging::GrayImage& picture = pictures_[static_cast<std::size_t>(v)];
    const int x0 = block % columns() * kBlock_px, y0 = block / columns() * kBlock_px;
    for (int y = y0; y < y0 + kBlock_px; ++y) {
      for (int x = x0; x < x0 + kBlock_px; ++x) {
        const auto pixel = flight_.camera.project(view.T_camera_ground * ground_position(x, y));
        if (!pixel || !(pixel->minCoeff() >= 0.0) || !(pixel->x() < picture.width - 1) ||
            !(pixel->y() < picture.height - 1))
          continue;
        image_.grey(x, y) = static_cast<std::uint8_t>(std::lround(bilinear(picture, pixel->x(), pixel->y())));
        image_.seen(x, y) = 255;
      }
    }
  }

  const FlightPictures& flight_;
  std::vector<View> views_;
  const MosaicOptions& options_;
  HeightModel heights_;
  GroundImage image_;
  std::vector<int> view_of_block_;  ///< view of each block; -1: none
  std::vector<imaging::GrayImage> pictures_;
};

}  // namespace

GroundImage build_flight_mosaic(const FlightPictures& flight, const std::vector<Vec3>& points, const Mat3& R_ground_map,
                                const MosaicOptions& options) {
  std::vector<View> views = select_views(flight, R_ground_map, options.max_pictures);
  std::vector<Vec3> turned;
  turned.reserve(points.size());
  for (const Vec3& p : points) turned.emplace_back(R_ground_map * p);
  const auto extent = find_extent(flight.camera, views, turned, options);
  if (!extent) return {};
  return MosaicBuilder(flight, turned, std::move(views), *extent, options).build();
}

}  // namespace tileflight::localization
