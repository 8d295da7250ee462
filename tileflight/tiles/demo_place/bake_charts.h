#pragma once

#include <vector>

#include "tileflight/core/imaging/textured_mesh.h"
#include "tileflight/tiles/demo_place/chart.h"
#include "tileflight/tiles/demo_place/sun.h"

namespace tileflight::demo_place {

/// Bakes charts, lit by the sun, into one texture atlas (charts packed as rectangles with painted gutters) and
/// triangulates their grids. `texture_scale` multiplies the texels per metre. Degenerate cells are left out. Empty
/// input gives an empty mesh.
imaging::TexturedMesh bake_charts(const std::vector<const Chart*>& charts, const Sunlight& sun, double texture_scale);

}  // namespace tileflight::demo_place
