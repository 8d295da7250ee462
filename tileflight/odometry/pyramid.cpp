#include "tileflight/odometry/pyramid.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <utility>

namespace tileflight::odometry {
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

PyramidLevel halved(const PyramidLevel& level) {
  PyramidLevel half{level.width / 2, level.height / 2, {}};
  half.grey.resize(static_cast<std::size_t>(half.width) * half.height + PyramidLevel::kPadding);
  for_rows(half.height, [&](int y) {
    const float* top = level.row(2 * y);
    const float* bottom = level.row(2 * y + 1);
    float* out = half.row(y);
    for (int x = 0; x < half.width; ++x) {
      out[x] = 0.25F * (top[2 * x] + top[2 * x + 1] + bottom[2 * x] + bottom[2 * x + 1]);
    }
  });
  return half;
}

/// G^-1 between whole grey values, linearly.
float irradiance(const std::array<float, 256>& inverse_response, float grey) {
  const int below = std::clamp(static_cast<int>(grey), 0, 254);
  const float rest = grey - static_cast<float>(below);
  return inverse_response[below] + rest * (inverse_response[below + 1] - inverse_response[below]);
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

FloatImage luminance(const imaging::RgbImage& image, const imaging::PhotometricCalibration* photometric) {
  FloatImage out;
  out.width = image.width;
  out.height = image.height;
  out.pixels.reserve(image.pixels.size() + PyramidLevel::kPadding);  // a pyramid takes it over without a copy
  out.pixels.resize(image.pixels.size());
  for_rows(image.height, [&](int y) {
    const imaging::Rgb8* in = image.row(y);
    float* to = out.row(y);
    for (int x = 0; x < image.width; ++x) {
      to[x] = 0.299F * static_cast<float>(in[x][0]) + 0.587F * static_cast<float>(in[x][1]) +
              0.114F * static_cast<float>(in[x][2]);
    }
    if (photometric == nullptr) return;
    for (int x = 0; x < image.width; ++x) to[x] = irradiance(photometric->inverse_response, to[x]);
    if (photometric->vignette.empty()) return;
    const float* vignette = photometric->vignette.row(y);
    for (int x = 0; x < image.width; ++x) to[x] /= vignette[x];
  });
  return out;
}

Pyramid build_pyramid(FloatImage image, int levels) {
  Pyramid pyramid;
  pyramid.levels.reserve(levels);
  image.pixels.resize(image.pixels.size() + PyramidLevel::kPadding);
  pyramid.levels.push_back({image.width, image.height, std::move(image.pixels)});
  for (int l = 1; l < levels; ++l) pyramid.levels.push_back(halved(pyramid.levels.back()));
  return pyramid;
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

}  // namespace tileflight::odometry
