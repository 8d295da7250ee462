#pragma once

#include "tileflight/imaging/textured_mesh.h"
#include "tileflight/tiling/surface_colors.h"

namespace tileflight::tiling {

struct PaintOptions {
  double texel_m = 0.1;  ///< edge of a texel on surfaces that face an axis
  int sheet_px = 4096;   ///< longest side of the sheet; texels grow until all fit
};

struct PaintedSurface {
  imaging::TexturedMesh mesh;
  double texel_m = 0.0;  ///< as it became
};

/// Gives a surface a texture of its own, with the colours of another surface near it. Triangles that face alike (up
/// within 60 degrees, else down or sideways) and meet make a chart, seen along its axis; each texel takes the colour of
/// the other surface's nearest point. Where a chart lies over itself, the outer triangle paints the texel. Vertices
/// that several charts use are repeated; positions stay.
PaintedSurface painted(const geometry::TriangleMesh& surface, const SurfaceColors& colors, const PaintOptions& options);

}  // namespace tileflight::tiling
