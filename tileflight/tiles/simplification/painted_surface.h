#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "tileflight/core/geometry/triangle_index.h"
#include "tileflight/core/imaging/textured_mesh.h"

namespace tileflight::simplification {

/// Numbers the triangles of several meshes consecutively: those of mesh 0 first, then those of mesh 1, ….
class TriangleNumbering {
 public:
  explicit TriangleNumbering(const std::vector<imaging::TexturedMesh>& meshes);
  explicit TriangleNumbering(const std::vector<const imaging::TexturedMesh*>& meshes);

  struct TriangleRef {
    std::size_t mesh = 0, triangle = 0;
  };

  TriangleRef operator()(std::uint32_t number) const;

 private:
  std::vector<std::uint32_t> first_;  ///< first number of each mesh, then the total count
};

/// Provides the colour of a surface near any point: texture times vertex colours times base colour at the nearest
/// surface point, sRGB. Queries may run in parallel.
class SurfaceColors {
 public:
  /// The meshes must outlive this object and must not all be empty.
  explicit SurfaceColors(std::vector<const imaging::TexturedMesh*> meshes);

  /// Answers queries. Each search starts at the triangle found last, so that queries close to each other are fast.
  /// Results do not depend on the order.
  class CoherentSampler {
   public:
    explicit CoherentSampler(const SurfaceColors& colors) : colors_(colors) {}
    /// The nearest point of the surface, whose triangle has the number that color() takes.
    geometry::SurfacePoint nearest(const geometry::Vec3& place);

   private:
    const SurfaceColors& colors_;
    bool has_last_ = false;
    std::uint32_t last_ = 0;
  };

  /// Whether some textures are deferred (imaging::with_pixels).
  bool has_deferred_textures() const;
  /// The texture at a triangle; null: it has none.
  const std::shared_ptr<const imaging::RgbImage>& texture(std::uint32_t triangle) const;
  /// The colour at a point of a triangle. `texture`: the triangle's, with its pixels.
  imaging::Rgb8 color(std::uint32_t triangle, const geometry::Vec3& on_surface, const imaging::RgbImage* texture) const;

 private:
  double distance_m(std::uint32_t number, const geometry::Vec3& place) const;

  std::vector<const imaging::TexturedMesh*> meshes_;
  TriangleNumbering numbering_;  ///< the numbers that the index uses
  geometry::TriangleIndex index_;
};

/// Resolution of a painted texture.
struct PaintOptions {
  double texel_m = 0.1;     ///< edge of a texel on surfaces that face an axis
  int max_atlas_px = 4096;  ///< longest side of the atlas; texels grow until all charts fit
};

/// A surface with its painted texture.
struct TexturedSurface {
  imaging::TexturedMesh mesh;
  double texel_m = 0.0;  ///< actual edge of a texel
};

/// Textures a surface with the colours of another surface near it. Connected triangles that face the same way (up
/// within 60 degrees, else down or sideways) form a chart, projected along its axis; each texel takes the colour of the
/// other surface's nearest point. Where a chart overlaps itself, the outer triangle paints the texel. Vertices used by
/// several charts are duplicated; positions do not change.
TexturedSurface transfer_colors(const geometry::TriangleMesh& surface, const SurfaceColors& colors,
                                const PaintOptions& options);

}  // namespace tileflight::simplification
