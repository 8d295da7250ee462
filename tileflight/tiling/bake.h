#pragma once

#include <vector>

#include "tileflight/imaging/textured_mesh.h"
#include "tileflight/tiling/chart.h"
#include "tileflight/tiling/sun.h"

namespace tileflight::tiling {

/// Paints charts under the sun into one texture (charts packed as rectangles with painted gutters) and joins their
/// grids to triangles. `texture_scale` multiplies the texels a metre. Cells without area are left out. Empty input
/// gives an empty mesh.
imaging::TexturedMesh bake(const std::vector<const Chart*>& charts, const Sunlight& sun, double texture_scale);

}  // namespace tileflight::tiling
