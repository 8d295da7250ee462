#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "tileflight/core/geometry/transform.h"
#include "tileflight/core/imaging/camera.h"

namespace tileflight::exports {

/// A reconstruction in COLMAP's text format: images of one camera with poses, points with the images that see them; or
/// images of a rig's cameras, without points.
struct ColmapModel {
  struct Image {
    std::string name;  ///< file name, without blanks
    geometry::SE3 T_world_camera;
    std::size_t camera = 0;  ///< 0: `camera`, else `others[camera - 1]`
  };
  /// A further camera of a rig.
  struct RigCamera {
    imaging::Camera camera;
    geometry::SE3 T_camera_first;  ///< from the first camera's frame
  };
  struct Point {
    geometry::Vec3 position = geometry::Vec3::Zero();  ///< world
    std::array<std::uint8_t, 3> color{};
    std::vector<int> image_indices;  ///< indices into `images`; the pixel is the point's projection
  };
  imaging::Camera camera;
  std::vector<Image> images;
  std::vector<Point> points{};
  std::vector<RigCamera> others{};
  std::vector<std::vector<std::size_t>> instants{};  ///< of a rig: indices into `images`, of one instant each
};

/// Throws InputError for a lens without a COLMAP model (double sphere, unified, extended unified).
void require_colmap_lens(const imaging::Camera& camera);

/// Writes cameras.txt, images.txt and points3D.txt into an existing folder; of a rig also rigs.txt and frames.txt, as
/// COLMAP has them since 3.12. COLMAP's pixel centres are at half
/// integers. An image is left out of a point's track if the point projects outside it. Point errors are -1 (not
/// computed). Throws InputError as require_colmap_lens.
void write_colmap(const std::filesystem::path& folder, const ColmapModel& model);

}  // namespace tileflight::exports
