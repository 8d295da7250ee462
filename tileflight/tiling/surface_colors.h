#pragma once

#include <vector>

#include "tileflight/geometry/triangle_index.h"
#include "tileflight/imaging/textured_mesh.h"

namespace tileflight::tiling {

/// Colour of a surface near any point: texture times vertex colours times base colour at the nearest surface point,
/// sRGB. Queries are const and may run in parallel.
class SurfaceColors {
 public:
  /// The meshes must outlive this object and must not all be empty.
  explicit SurfaceColors(std::vector<const imaging::TexturedMesh*> meshes);

  /// Faster for consecutive queries close to each other: each search starts at the triangle found last. Results do not
  /// depend on it.
  class CoherentSampler {
   public:
    explicit CoherentSampler(const SurfaceColors& colors) : colors_(colors) {}
    imaging::Rgb8 at(const geometry::Vec3& place);

   private:
    const SurfaceColors& colors_;
    bool has_last_ = false;
    std::size_t last_ = 0;
  };

 private:
  struct TriangleRef {
    std::size_t mesh = 0, triangle = 0;
  };

  TriangleRef locate_triangle(std::size_t number) const;
  double distance_m(std::size_t number, const geometry::Vec3& place) const;
  imaging::Rgb8 color(std::size_t number, const geometry::Vec3& on_surface) const;

  std::vector<const imaging::TexturedMesh*> meshes_;
  std::vector<std::size_t> first_;  ///< number of each mesh's first triangle
  geometry::TriangleIndex index_;
};

}  // namespace tileflight::tiling
