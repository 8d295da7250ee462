#include "tileflight/tiles/demo_place/photogrammetry.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <memory>

#include "tileflight/core/base/noise.h"
#include "tileflight/tiles/simplification/simplify.h"
#include "tileflight/tiles/tile_writer/texture_filter.h"

namespace tileflight::demo_place {
namespace {

using geometry::Vec3;
using imaging::RgbImage;

/// Standard deviation of fractal_noise with three octaves, about 0.43 (measured in the tests).
constexpr double kNoiseDeviation = 0.43;

Vec3 surface_error(const Vec3& p, const PhotogrammetryOptions& options) {
  const Vec3 q = p / options.noise_length_m;
  Vec3 error;
  for (std::uint32_t axis = 0; axis < 3; ++axis)
    error[axis] = base::fractal_noise_3d(q.x(), q.y(), q.z(), options.seed + 0x1000U * (axis + 1), 3);
  return options.noise_m / kNoiseDeviation * error;
}

std::shared_ptr<const RgbImage> blur_and_reduce(const RgbImage& image, int reduction) {
  const auto reduced = [&](int length) { return std::max(1, (length + reduction - 1) / reduction); };
  return std::make_shared<const RgbImage>(
      tile_writer::blur_binomial(tile_writer::resize_area(image, reduced(image.width), reduced(image.height))));
}

}  // namespace

std::vector<imaging::TexturedMesh> simulate_photogrammetry(const std::vector<imaging::TexturedMesh>& meshes,
                                                           const PhotogrammetryOptions& options) {
  std::vector<imaging::TexturedMesh> out = simplification::simplify_meshes(meshes, options.simplification_m);
  tbb::parallel_for(std::size_t{0}, out.size(), [&](std::size_t i) {
    for (Vec3& vertex : out[i].mesh.vertices) vertex += surface_error(vertex, options);
    if (out[i].texture) out[i].texture = blur_and_reduce(*out[i].texture, options.texture_reduction);
  });
  return out;
}

}  // namespace tileflight::demo_place
