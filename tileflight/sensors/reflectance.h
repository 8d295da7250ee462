#pragma once

#include "tileflight/scene/scene.h"
#include "tileflight/sensors/appearance.h"

namespace tileflight::sensors {

/// Share of the light that the surface at a hit gives back: the luminance (ITU-R BT.709) of its colour in linear light,
/// from 0 to 1. Tiles have no other reflectance than their pictures' colours, shadows in them included.
class Reflectance {
 public:
  /// Both must outlive it.
  Reflectance(const scene::Scene& scene, const Appearance& appearance) : scene_(scene), appearance_(appearance) {}

  /// Averaged over a spot as wide as `footprint_m`.
  double at(const scene::Hit& hit, double footprint_m) const;

 private:
  const scene::Scene& scene_;
  const Appearance& appearance_;
};

}  // namespace tileflight::sensors
