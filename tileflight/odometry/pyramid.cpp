#include "tileflight/odometry/pyramid.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>

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

FloatImage halved(const FloatImage& image) {
  FloatImage half(image.width / 2, image.height / 2);
  for_rows(half.height, [&](int y) {
    const float* top = image.row(2 * y);
    const float* bottom = image.row(2 * y + 1);
    float* out = half.row(y);
    for (int x = 0; x < half.width; ++x) {
      out[x] = 0.25F * (top[2 * x] + top[2 * x + 1] + bottom[2 * x] + bottom[2 * x + 1]);
    }
  });
  return half;
}

/// Central differences; the outermost pixels have none.
PyramidLevel with_gradients(const FloatImage& image) {
  PyramidLevel level{image.width, image.height, std::vector<Texel>(image.pixels.size())};
  for_rows(image.height, [&](int y) {
    const bool edge_row = y == 0 || y == image.height - 1;
    const float* here = image.row(y);
    const float* above = image.row(edge_row ? y : y - 1);
    const float* below = image.row(edge_row ? y : y + 1);
    Texel* out = level.texels.data() + static_cast<std::size_t>(y) * image.width;
    const auto write = [&](int x, float gx, float gy) { out[x] = Texel{here[x], gx, gy, gx * gx + gy * gy}; };
    write(0, 0.0F, 0.0F);
    for (int x = 1; x < image.width - 1; ++x) {
      write(x, edge_row ? 0.0F : 0.5F * (here[x + 1] - here[x - 1]), 0.5F * (below[x] - above[x]));
    }
    write(image.width - 1, 0.0F, 0.0F);
  });
  return level;
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
  FloatImage out(image.width, image.height);
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

Pyramid build_pyramid(const FloatImage& image, int levels) {
  Pyramid pyramid;
  FloatImage current = image;
  for (int l = 0; l < levels; ++l) {
    if (l > 0) current = halved(current);
    pyramid.levels.push_back(with_gradients(current));
  }
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
