#include "tileflight/slam/keyframes/pyramid.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <utility>

namespace tileflight::keyframes {
namespace {

using imaging::FloatImage;

constexpr int kRowsPerTask = 32;

/// Calls `row(y)` for each row, in parallel; rows must not touch each other's output.
template <class Row>
void for_rows(int height, const Row& row) {
  tbb::parallel_for(tbb::blocked_range<int>(0, height, kRowsPerTask), [&](const tbb::blocked_range<int>& range) {
    for (int y = range.begin(); y < range.end(); ++y) row(y);
  });
}

/// Means of 2x2 pixels, `width` of them.
TILEFLIGHT_WIDE_VECTORS
void downsample_rows(const float* top, const float* bottom, int width, float* out) {
  int x = 0;
  for (; x + base::kLanes <= width; x += base::kLanes) {
    base::Float8 a, b, c, d;
    base::load_float8(top + 2 * x, a), base::load_float8(top + 2 * x + base::kLanes, b);
    base::load_float8(bottom + 2 * x, c), base::load_float8(bottom + 2 * x + base::kLanes, d);
    const base::Float8 sum = ((__builtin_shufflevector(a, b, 0, 2, 4, 6, 8, 10, 12, 14) +
                               __builtin_shufflevector(a, b, 1, 3, 5, 7, 9, 11, 13, 15)) +
                              __builtin_shufflevector(c, d, 0, 2, 4, 6, 8, 10, 12, 14)) +
                             __builtin_shufflevector(c, d, 1, 3, 5, 7, 9, 11, 13, 15);
    base::store_float8(0.25F * sum, out + x);
  }
  for (; x < width; ++x) out[x] = 0.25F * (top[2 * x] + top[2 * x + 1] + bottom[2 * x] + bottom[2 * x + 1]);
}

/// Luma (Rec. 601) of a row, not rounded.
static_assert(std::endian::native == std::endian::little, "luma_row takes pixels' bytes out of words");
TILEFLIGHT_WIDE_VECTORS
void luma_row(const imaging::Rgb8* in, int width, float* out) {
  constexpr float kRed = 0.299F, kGreen = 0.587F, kBlue = 0.114F;
  int x = 0;
  for (; x + base::kLanes < width; x += base::kLanes) {  // loading a pixel as a word reads into the next pixel
    base::Mask8 words;
    for (int i = 0; i < base::kLanes; ++i) {
      std::int32_t word;
      std::memcpy(&word, in + x + i, sizeof(word));
      words[i] = word;
    }
    const base::Float8 r = __builtin_convertvector(words & 0xff, base::Float8);
    const base::Float8 g = __builtin_convertvector(words >> 8 & 0xff, base::Float8);
    const base::Float8 b = __builtin_convertvector(words >> 16 & 0xff, base::Float8);
    base::store_float8(kRed * r + kGreen * g + kBlue * b, out + x);
  }
  for (; x < width; ++x) {
    out[x] = kRed * static_cast<float>(in[x][0]) + kGreen * static_cast<float>(in[x][1]) +
             kBlue * static_cast<float>(in[x][2]);
  }
}

PyramidLevel downsample(const PyramidLevel& level, std::vector<float> memory) {
  PyramidLevel half{level.width / 2, level.height / 2, std::move(memory)};
  half.grey.resize(static_cast<std::size_t>(half.width) * half.height + PyramidLevel::kPadding);
  for_rows(half.height, [&](int y) {
    const float* top = level.row(2 * y);
    const float* bottom = level.row(2 * y + 1);
    downsample_rows(top, bottom, half.width, half.row(y));
  });
  return half;
}

/// G^-1 (DSO, eq. 3), linearly interpolated between whole grey values.
float irradiance(const std::array<float, 256>& inverse_response, float grey) {
  const int below = std::clamp(static_cast<int>(grey), 0, 254);
  const float rest = grey - static_cast<float>(below);
  return inverse_response[below] + rest * (inverse_response[below + 1] - inverse_response[below]);
}

/// Bilinearly interpolated ray between pixels; zero if one of the four has none. Rays change so little from pixel to
/// pixel that the error is below a thousandth of a pixel.
Eigen::Vector3f interpolated_ray(const RayTable& table, const geometry::Vec2& at) {
  const int x = static_cast<int>(std::floor(at.x())), y = static_cast<int>(std::floor(at.y()));
  if (x < 0 || y < 0 || x + 1 >= table.width || y + 1 >= table.height) return Eigen::Vector3f::Zero();
  const auto dx = static_cast<float>(at.x() - x), dy = static_cast<float>(at.y() - y);
  const std::array<Eigen::Vector3f, 4> corners{table.at(x, y), table.at(x + 1, y), table.at(x, y + 1),
                                               table.at(x + 1, y + 1)};
  for (const Eigen::Vector3f& corner : corners) {
    if (corner.isZero(0)) return Eigen::Vector3f::Zero();
  }
  const Eigen::Vector3f top = corners[0] + dx * (corners[1] - corners[0]);
  const Eigen::Vector3f bottom = corners[2] + dx * (corners[3] - corners[2]);
  return (top + dy * (bottom - top)).normalized();
}

}  // namespace

int pyramid_levels(int width, int height, const OdometryOptions& options) {
  int levels = 1;
  while (levels < options.max_pyramid_levels &&
         static_cast<long>(width >> levels) * (height >> levels) >= options.min_level_area_px) {
    ++levels;
  }
  return levels;
}

FloatImage make_image_in(FloatImage memory, int width, int height) {
  const std::size_t count = static_cast<std::size_t>(width) * height;
  memory.width = width;
  memory.height = height;
  memory.pixels.reserve(count + PyramidLevel::kPadding);  // a pyramid takes it over without a copy
  memory.pixels.resize(count);
  return memory;
}

FloatImage luminance(const imaging::RgbImage& image, const imaging::PhotometricCalibration* photometric,
                     FloatImage memory) {
  FloatImage out = make_image_in(std::move(memory), image.width, image.height);
  for_rows(image.height, [&](int y) {
    float* to = out.row(y);
    luma_row(image.row(y), image.width, to);
    if (photometric == nullptr) return;
    for (int x = 0; x < image.width; ++x) to[x] = irradiance(photometric->inverse_response, to[x]);
    if (photometric->vignette.empty()) return;
    const float* vignette = photometric->vignette.row(y);
    for (int x = 0; x < image.width; ++x) to[x] /= vignette[x];
  });
  return out;
}

Pyramid build_pyramid(FloatImage image, int levels, Pyramid memory) {
  memory.levels.resize(static_cast<std::size_t>(levels));
  Pyramid pyramid;
  pyramid.levels.reserve(levels);
  image.pixels.resize(image.pixels.size() + PyramidLevel::kPadding);
  pyramid.levels.push_back({image.width, image.height, std::move(image.pixels)});
  for (int l = 1; l < levels; ++l) {
    pyramid.levels.push_back(downsample(pyramid.levels.back(), std::move(memory.levels[l].grey)));
  }
  return pyramid;
}

Pyramid PyramidPool::acquire() {
  const std::lock_guard lock(store_->mutex);
  if (store_->free.empty()) return {};
  Pyramid pyramid = std::move(store_->free.back());
  store_->free.pop_back();
  return pyramid;
}

std::shared_ptr<const Pyramid> PyramidPool::make(const imaging::RgbImage& image,
                                                 const imaging::PhotometricCalibration* photometric, int levels) {
  return make([&](FloatImage memory) { return luminance(image, photometric, std::move(memory)); }, levels);
}

std::shared_ptr<const Pyramid> PyramidPool::make(const std::function<FloatImage(FloatImage)>& picture, int levels) {
  Pyramid memory = acquire();
  FloatImage grey;
  if (!memory.levels.empty()) grey.pixels = std::move(memory.levels[0].grey);
  auto made = std::make_unique<Pyramid>(build_pyramid(picture(std::move(grey)), levels, std::move(memory)));
  return {made.release(), [store = store_](Pyramid* pyramid) {
            const std::unique_ptr<Pyramid> owned(pyramid);
            const std::lock_guard lock(store->mutex);
            store->free.push_back(std::move(*owned));
          }};
}

LensPyramid build_lens_pyramid(const imaging::Camera& camera, int levels) {
  LensPyramid pyramid;
  const Lens lens(camera);
  for (int l = 0; l < levels; ++l) {
    const Lens level = lens.at_level(l);
    RayTable table{camera.width() >> l, camera.height() >> l, {}};
    table.rays.resize(static_cast<std::size_t>(table.width) * table.height, Eigen::Vector3f::Zero());
    for_rows(table.height, [&](int y) {
      for (int x = 0; x < table.width; ++x) {
        const auto ray = level.unproject(geometry::Vec2(x, y));
        if (ray) table.rays[static_cast<std::size_t>(y) * table.width + x] = ray->cast<float>();
      }
    });
    pyramid.lenses.push_back(level);
    pyramid.rays.push_back(std::move(table));
  }
  return pyramid;
}

Eigen::Vector3f LensPyramid::ray(std::size_t level, int x, int y) const {
  const RayTable& table = rays[level];
  const Lens& lens = lenses[level];
  if (!lens.has_delta() || table.at(x, y).isZero(0)) return table.at(x, y);
  const Eigen::Vector3f between = interpolated_ray(table, lens.nominal_pixel(geometry::Vec2(x, y)));
  if (!between.isZero(0)) return between;
  const auto exact = lens.unproject(geometry::Vec2(x, y));
  return exact ? Eigen::Vector3f(exact->cast<float>()) : Eigen::Vector3f(Eigen::Vector3f::Zero());
}

void set_intrinsics_delta(LensPyramid& lens, const IntrinsicsDelta& delta) {
  for (Lens& level : lens.lenses) level = level.apply_delta(delta);
}

}  // namespace tileflight::keyframes
