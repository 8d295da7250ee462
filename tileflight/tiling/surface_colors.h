#pragma once

#include <vector>

#include "tileflight/geometry/triangle_index.h"
#include "tileflight/imaging/textured_mesh.h"

namespace tileflight::tiling {

/// What a surface looks like near any place: texture times vertex colours times base colour at its nearest point, as
/// displayed. Queries are const and may run in parallel.
class SurfaceColors {
 public:
  /// The meshes must outlive this; they are not all empty.
  explicit SurfaceColors(std::vector<const imaging::TexturedMesh*> meshes);

  /// A row of queries close to each other: each begins with the triangle that the last one found. What they find does
  /// not depend on it.
  class Walk {
   public:
    explicit Walk(const SurfaceColors& colors) : colors_(colors) {}
    imaging::Rgb8 at(const geometry::Vec3& place);

   private:
    const SurfaceColors& colors_;
    bool has_last_ = false;
    std::size_t last_ = 0;
  };

 private:
  struct Place {
    std::size_t mesh = 0, triangle = 0;
  };

  Place place_of(std::size_t number) const;
  double distance_m(std::size_t number, const geometry::Vec3& place) const;
  imaging::Rgb8 color(std::size_t number, const geometry::Vec3& on_surface) const;

  std::vector<const imaging::TexturedMesh*> meshes_;
  std::vector<std::size_t> first_;  ///< number of each mesh's first triangle
  geometry::TriangleIndex index_;
};

}  // namespace tileflight::tiling
