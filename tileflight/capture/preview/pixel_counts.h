#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include "tileflight/capture/preview/coverage.h"
#include "tileflight/core/geometry/trajectory.h"
#include "tileflight/core/imaging/camera.h"
#include "tileflight/tiles/tileset/selection.h"
#include "tileflight/world/scene/scene.h"

namespace tileflight::preview {

/// The flight's lens and the sampled poses.
struct FrameSampling {
  imaging::Camera camera;
  geometry::Trajectory trajectory;
  std::vector<std::size_t> frames;  ///< indices into trajectory
  std::vector<std::string> notes;   ///< what was assumed of the flight; a sentence each

  const geometry::SE3& pose(std::size_t i) const { return trajectory.poses[frames[i]].T_local_camera; }
};

/// Chooses frames evenly spread over the flight. Throws InputError.
FrameSampling sample_frames(const CoverageSettings& settings);

/// Scales a lens to images of this width, if its own are wider.
imaging::Camera scale_to_width(const imaging::Camera& camera, int width);

/// The surface hit by a pixel's central ray in the finest tiles.
struct PixelHit {
  static constexpr std::uint32_t kNoContent = std::numeric_limits<std::uint32_t>::max();
  std::uint32_t content = kNoContent;  ///< index of the tile content that holds the triangle
  double distance_m = 0.0;
};

/// Returns the unit directions of a lens's pixels in the camera's frame, row by row; nullopt outside its valid cone.
std::vector<std::optional<geometry::Vec3>> pixel_rays(const imaging::Camera& camera);

/// Traces a frame's pixels through one part of a scene: `nearest` has the nearest hits of the parts traced before (all
/// parts have the same anchor), none at first. `content_of_mesh`: the content index of each of the part's meshes.
void trace_pixels(const scene::Scene& part, const std::vector<std::uint32_t>& content_of_mesh,
                  const std::vector<std::optional<geometry::Vec3>>& rays, const geometry::SE3& T_local_camera,
                  std::vector<PixelHit>& nearest);

/// A tile that may replace a content's surface: the content's own tile, or an ancestor up to the first one that is not
/// replaced by its children (an ADD tile's content is shown beside its children's and does not replace them).
struct Substitute {
  tileset::NodeId node = 0;
  double geometric_error_m = 0.0;
};
/// Lists the substitutes of a content, its own tile first.
std::vector<Substitute> find_substitutes(const tileset::TilesetTree& tree, const tileset::CutContent& content);

/// Counts of a frame's pixels for a set of loaded tiles.
struct PixelCounts {
  std::int64_t pixels = 0;  ///< pixels that see a surface
  std::int64_t right = 0;
  std::int64_t coarser = 0;
  std::int64_t missing = 0;

  double share(std::int64_t count) const { return pixels > 0 ? static_cast<double>(count) / pixels : 0.0; }
};

/// Counts pixels. `substitutes[c]`: the substitutes of content c. A pixel is right if the nearest substitute in memory
/// is the content's own tile, or has an error of at most `error_px` there, for a lens with `pixels_per_rad` pixels per
/// radian.
PixelCounts count_pixels(const std::vector<PixelHit>& frame, const std::vector<std::vector<Substitute>>& substitutes,
                         const std::vector<bool>& node_in_memory, double pixels_per_rad, double error_px);

}  // namespace tileflight::preview
