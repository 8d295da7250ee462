#include "tileflight/capture/render/reflectance.h"

#include <algorithm>

#include "tileflight/capture/render/surface_color.h"

namespace tileflight::render {

double Reflectance::at(const scene::Hit& hit, double footprint_m) const {
  const LinearRgb light = surface_color(scene_, appearance_, hit, footprint_m);
  return std::clamp(0.2126 * light[0] + 0.7152 * light[1] + 0.0722 * light[2], 0.0, 1.0);
}

}  // namespace tileflight::render
