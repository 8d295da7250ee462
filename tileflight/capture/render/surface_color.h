#pragma once

#include "tileflight/capture/render/appearance.h"
#include "tileflight/capture/render/linear_color.h"
#include "tileflight/world/scene/scene.h"

namespace tileflight::render {

/// Linear colour of the surface at a hit, averaged over a spot of width `footprint_m`: texture times vertex and base
/// colours. White if it has neither. `appearance` must be that of `scene`.
LinearRgb surface_color(const scene::Scene& scene, const Appearance& appearance, const scene::Hit& hit,
                        double footprint_m);

}  // namespace tileflight::render
