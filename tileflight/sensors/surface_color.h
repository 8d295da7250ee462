#pragma once

#include "tileflight/scene/scene.h"
#include "tileflight/sensors/appearance.h"
#include "tileflight/sensors/light.h"

namespace tileflight::sensors {

/// The surface's colour at a hit, averaged over a spot as wide as `footprint_m`: its texture times its colours, in
/// linear light. White where it has neither. `appearance` is the scene's own.
Light surface_color(const scene::Scene& scene, const Appearance& appearance, const scene::Hit& hit, double footprint_m);

}  // namespace tileflight::sensors
