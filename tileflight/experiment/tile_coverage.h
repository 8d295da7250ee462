#pragma once

#include <cstdint>
#include <limits>
#include <vector>

#include "tileflight/imaging/camera.h"
#include "tileflight/scene/scene.h"
#include "tileflight/tiles/selection.h"

namespace tileflight::experiment {

/// What a pixel's central ray meets in the finest place.
struct SeenPixel {
  static constexpr std::uint32_t kNothing = std::numeric_limits<std::uint32_t>::max();
  std::uint32_t content = kNothing;  ///< index of the content that the triangle is of
  double distance_m = 0.0;
};

/// A frame's pixels, row by row. `content_of_mesh`: for each of the scene's meshes the content that it came from.
std::vector<SeenPixel> see(const scene::Scene& scene, const std::vector<std::uint32_t>& content_of_mesh,
                           const imaging::Camera& camera, const geometry::SE3& T_local_camera);

/// Tiles that can stand for a content's surface: itself, and the tiles above it as long as they are replaced by what
/// lies below them (an ADD tile's content stays beside its children's and does not stand for them).
struct Stand {
  tiles::NodeId node = 0;
  double geometric_error_m = 0.0;
};
std::vector<Stand> stands_for(const tiles::TilesetTree& tree, const tiles::CutContent& content);

/// What the pixels of a frame that see a surface get of a set of tiles.
struct PixelShares {
  std::int64_t pixels = 0;  ///< that see a surface
  std::int64_t right = 0;
  std::int64_t coarser = 0;
  std::int64_t missing = 0;

  double share(std::int64_t count) const { return pixels > 0 ? static_cast<double>(count) / pixels : 0.0; }
};

/// `stands[c]`: of content c. A pixel is right when the nearest of its stands that is in memory is the content's own
/// tile, or errs by at most `error_px` there, with a lens that shows a radian on `pixels_per_rad` pixels.
PixelShares count_pixels(const std::vector<SeenPixel>& frame, const std::vector<std::vector<Stand>>& stands,
                         const std::vector<bool>& node_in_memory, double pixels_per_rad, double error_px);

}  // namespace tileflight::experiment
