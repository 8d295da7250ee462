#pragma once

#include "tileflight/core/imaging/textured_mesh.h"
#include "tileflight/tiles/tile_writer/surface_colors.h"

namespace tileflight::tile_writer {

struct PaintOptions {
  double texel_m = 0.1;     ///< edge of a texel on surfaces that face an axis
  int max_atlas_px = 4096;  ///< longest side of the atlas; texels grow until all charts fit
};

struct TexturedSurface {
  imaging::TexturedMesh mesh;
  double texel_m = 0.0;  ///< actual texel size
};

/// Textures a surface with the colours of another surface near it. Connected triangles that face the same way (up
/// within 60 degrees, else down or sideways) form a chart, projected along its axis; each texel takes the colour of the
/// other surface's nearest point. Where a chart overlaps itself, the outer triangle paints the texel. Vertices used by
/// several charts are duplicated; positions do not change.
TexturedSurface transfer_colors(const geometry::TriangleMesh& surface, const SurfaceColors& colors,
                                const PaintOptions& options);

}  // namespace tileflight::tile_writer
