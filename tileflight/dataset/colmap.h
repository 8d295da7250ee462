#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "tileflight/geometry/transform.h"
#include "tileflight/imaging/camera.h"

namespace tileflight::dataset {

/// A reconstruction as COLMAP's text format holds it: one lens, pictures with poses, points with the pictures that see
/// them.
struct ColmapModel {
  struct Picture {
    std::string name;  ///< of the file, without blanks
    geometry::SE3 T_world_camera;
  };
  struct Point {
    geometry::Vec3 position = geometry::Vec3::Zero();  ///< world
    std::array<std::uint8_t, 3> color{};
    std::vector<int> pictures;  ///< positions in `pictures`; its pixel is where it projects
  };
  imaging::Camera camera;
  std::vector<Picture> pictures;
  std::vector<Point> points;
};

/// Throws InputError for a lens that COLMAP has no model for (double sphere, unified, extended unified).
void require_colmap_lens(const imaging::Camera& camera);

/// Writes cameras.txt, images.txt and points3D.txt into a folder that exists. COLMAP's pixel centres are at halves. A
/// picture in which a point does not project inside is left out of its track. Errors of points are -1 (not computed).
/// Throws InputError as require_colmap_lens.
void write_colmap(const std::filesystem::path& folder, const ColmapModel& model);

}  // namespace tileflight::dataset
