#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "tileflight/imaging/textured_mesh.h"

// Photogrammetry packs many pieces of surface (charts) into one texture, with padding between them. Coarse mip levels
// mix what lies side by side there but not on the surface; what is found here keeps that away.
namespace tileflight::sensors {

/// Whether all texture coordinates lie within 0..1 (up to a thousandth). Reads at such a texture's rim need not wrap
/// around to its other side.
bool within_image(const imaging::TexturedMesh& mesh);

/// 255 for each texel that some triangle of `meshes` touches, 0 for padding. All meshes have the same texture and
/// texture coordinates. Empty where everything is shown, or where coordinates leave 0..1 (a texture that repeats has no
/// padding).
imaging::GrayImage texture_coverage(std::span<const imaging::TexturedMesh* const> meshes);

/// For each triangle the mip level whose texels are about as wide as the chart it belongs to (triangles that are joined
/// by common texture coordinates). Coarser texels would show other charts.
std::vector<std::int32_t> chart_levels(const imaging::TexturedMesh& mesh);

}  // namespace tileflight::sensors
