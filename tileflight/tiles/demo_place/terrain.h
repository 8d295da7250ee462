#pragma once

#include <vector>

#include "tileflight/tiles/demo_place/site_plan.h"

namespace tileflight::demo_place {

/// Height of the ground: a flat field in a bowl whose rims carry the stands, hills outside, level pads under buildings
/// and car parks, bumps of centimetres on grass. Metres above the field.
class Terrain {
 public:
  explicit Terrain(const SitePlan& plan);

  double height_m(double x, double y) const;
  /// Unit normal, by finite differences over half a metre.
  Vec3 normal(double x, double y) const;
  Vec3 point(double x, double y) const { return {x, y, height_m(x, y)}; }

 private:
  struct Pad {
    Rect area;
    double height_m = 0.0;
    double margin_m = 6.0;
  };

  double natural_height_m(double x, double y) const;
  double unevenness_m(double x, double y) const;

  std::vector<Pad> pads_;
  std::uint32_t seed_;
};

}  // namespace tileflight::demo_place
