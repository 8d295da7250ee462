#include "tileflight/experiment/tile_coverage.h"

#include <tbb/parallel_for.h>

#include <optional>

namespace tileflight::experiment {
namespace {

enum class Shown { kRight, kCoarser, kMissing };

Shown shown(const SeenPixel& pixel, const std::vector<Stand>& stands, const std::vector<bool>& node_in_memory,
            double pixels_per_rad, double error_px) {
  for (const Stand& stand : stands) {
    if (!node_in_memory[stand.node]) continue;
    const bool own = stand.node == stands.front().node;
    const bool fine = stand.geometric_error_m * pixels_per_rad <= error_px * pixel.distance_m;
    return own || fine ? Shown::kRight : Shown::kCoarser;
  }
  return Shown::kMissing;
}

}  // namespace

std::vector<SeenPixel> see(const scene::Scene& scene, const std::vector<std::uint32_t>& content_of_mesh,
                           const imaging::Camera& camera, const geometry::SE3& T_local_camera) {
  const auto width = static_cast<std::size_t>(camera.width());
  std::vector<SeenPixel> pixels(width * static_cast<std::size_t>(camera.height()));
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

std::vector<Stand> stands_for(const tiles::TilesetTree& tree, const tiles::CutContent& content) {
  std::vector<Stand> stands{{content.node, tree.geometric_error_m(content.node)}};
  for (auto above = tree.node(content.node).parent; above; above = tree.node(*above).parent) {
    if (tree.node(*above).refine == tiles::Refine::kAdd) break;
    stands.push_back({*above, tree.geometric_error_m(*above)});
  }
  return stands;
}

PixelShares count_pixels(const std::vector<SeenPixel>& frame, const std::vector<std::vector<Stand>>& stands,
                         const std::vector<bool>& node_in_memory, double pixels_per_rad, double error_px) {
  PixelShares shares;
  for (const SeenPixel& pixel : frame) {
    if (pixel.content == SeenPixel::kNothing) continue;
    ++shares.pixels;
    switch (shown(pixel, stands[pixel.content], node_in_memory, pixels_per_rad, error_px)) {
      case Shown::kRight:
        ++shares.right;
        break;
      case Shown::kCoarser:
        ++shares.coarser;
        break;
      case Shown::kMissing:
        ++shares.missing;
        break;
    }
  }
  return shares;
}

}  // namespace tileflight::experiment
