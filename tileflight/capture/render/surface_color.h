#pragma once

#include "tileflight/capture/render/appearance.h"
#include "tileflight/capture/render/linear_color.h"
#include "tileflight/world/scene/scene.h"

namespace tileflight::render {

/// Reflectance of the surface at a hit, 0 to 1: the luminance (ITU-R BT.709) of its colour in linear light. Tiles
/// provide no other reflectance than their textures, including baked shadows.
class Reflectance {
 public:
  /// Both arguments must outlive this object.
  Reflectance(const scene::Scene& scene, const Appearance& appearance) : scene_(scene), appearance_(appearance) {}

  /// Returns the reflectance averaged over a spot of width `footprint_m`.
  double at(const scene::Hit& hit, double footprint_m) const;

 private:
  const scene::Scene& scene_;
  const Appearance& appearance_;
};

/// Returns the linear colour of the surface at a hit, averaged over a spot of width `footprint_m`: texture times vertex
/// and base colours. White if it has neither. `appearance` must be that of `scene`.
LinearRgb surface_color(const scene::Scene& scene, const Appearance& appearance, const scene::Hit& hit,
                        double footprint_m);

/// Returns the opacity of the surface at a hit, 0 to 1, averaged over a spot of width `footprint_m`: 1 for all surfaces
/// but those that blend. `appearance` must be that of `scene`.
float surface_opacity(const scene::Scene& scene, const Appearance& appearance, const scene::Hit& hit,
                      double footprint_m);

}  // namespace tileflight::render
