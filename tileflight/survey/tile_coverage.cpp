#include "tileflight/survey/tile_coverage.h"

#include <tbb/parallel_for.h>

#include <optional>

namespace tileflight::survey {
namespace {

enum class PixelQuality { kRight, kCoarser, kMissing };

PixelQuality classify_pixel(const PixelHit& pixel, const std::vector<Substitute>& substitutes,
                            const std::vector<bool>& node_in_memory, double pixels_per_rad, double error_px) {
  for (const Substitute& substitute : substitutes) {
    if (!node_in_memory[substitute.node]) continue;
    const bool own = substitute.node == substitutes.front().node;
    const bool fine = substitute.geometric_error_m * pixels_per_rad <= error_px * pixel.distance_m;
    return own || fine ? PixelQuality::kRight : PixelQuality::kCoarser;
  }
  return PixelQuality::kMissing;
}

}  // namespace

std::vector<PixelHit> trace_pixels(const scene::Scene& scene, const std::vector<std::uint32_t>& content_of_mesh,
                                   const imaging::Camera& camera, const geometry::SE3& T_local_camera) {
  const auto width = static_cast<std::size_t>(camera.width());
  std::vector<PixelHit> pixels(width * static_cast<std::size_t>(camera.height()));
  tbb::parallel_for(0, camera.height(), [&](int y) {
    for (std::size_t x = 0; x < width; ++x) {
      const std::optional<geometry::Vec3> ray = camera.unproject({static_cast<double>(x), static_cast<double>(y)});
      if (!ray) continue;
      const auto hit = scene.intersect({T_local_camera.translation, T_local_camera.rotation * *ray});
      if (hit) pixels[static_cast<std::size_t>(y) * width + x] = {content_of_mesh[hit->mesh], hit->distance_m};
    }
  });
  return pixels;
}

std::vector<Substitute> find_substitutes(const tiles::TilesetTree& tree, const tiles::CutContent& content) {
  std::vector<Substitute> substitutes{{content.node, tree.geometric_error_m(content.node)}};
  for (auto above = tree.node(content.node).parent; above; above = tree.node(*above).parent) {
    if (tree.node(*above).refine == tiles::Refine::kAdd) break;
    substitutes.push_back({*above, tree.geometric_error_m(*above)});
  }
  return substitutes;
}

PixelCounts count_pixels(const std::vector<PixelHit>& frame, const std::vector<std::vector<Substitute>>& substitutes,
                         const std::vector<bool>& node_in_memory, double pixels_per_rad, double error_px) {
  PixelCounts shares;
  for (const PixelHit& pixel : frame) {
    if (pixel.content == PixelHit::kNoContent) continue;
    ++shares.pixels;
    switch (classify_pixel(pixel, substitutes[pixel.content], node_in_memory, pixels_per_rad, error_px)) {
      case PixelQuality::kRight:
        ++shares.right;
        break;
      case PixelQuality::kCoarser:
        ++shares.coarser;
        break;
      case PixelQuality::kMissing:
        ++shares.missing;
        break;
    }
  }
  return shares;
}

}  // namespace tileflight::survey
