#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "tileflight/core/imaging/textured_mesh.h"

// Photogrammetry packs many pieces of surface (charts) into one texture, with padding between them. Coarse mip levels
// mix texels that are adjacent there but not on the surface; the functions below prevent that.
namespace tileflight::render {

/// Whether all texture coordinates lie within 0..1 (with a tolerance of a thousandth). Reads at the edge of such a
/// texture need not wrap around.
bool within_image(const imaging::TexturedMesh& mesh);

/// 255 for each texel touched by a triangle of `meshes`, 0 for padding. All meshes have the same texture and texture
/// coordinates. Empty if all texels are used, or if coordinates leave 0..1 (a repeating texture has no padding).
imaging::GrayImage texture_coverage(std::span<const imaging::TexturedMesh* const> meshes);

/// For each triangle, the mip level whose texels are about as wide as its chart (triangles connected by common texture
/// coordinates). Coarser texels would mix in other charts.
std::vector<std::int32_t> chart_max_mip_levels(const imaging::TexturedMesh& mesh);

}  // namespace tileflight::render
