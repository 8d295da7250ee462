#pragma once

#include <vector>

#include "tileflight/core/imaging/textured_mesh.h"
#include "tileflight/tiles/demo_place/chart.h"

namespace tileflight::demo_place {

/// Sunlight and skylight that are baked into the textures, as photogrammetry captures them. Shadows come from a depth
/// map seen from the sun (Williams, "Casting curved shadows on curved surfaces", SIGGRAPH 1978), filtered between its
/// cells.
class Sunlight {
 public:
  /// `toward_sun`: any length, site frame. `charts` cast the shadows.
  Sunlight(const Vec3& toward_sun, const std::vector<Chart>& charts, double cell_m);

  /// Returns the factor on the unlit colour, about 0.4 (shadow) to 1.1 (facing the sun).
  float light_factor(const Vec3& position, const Vec3& normal) const;

 private:
  void rasterize_shadow(const Vec3& a, const Vec3& b, const Vec3& c);
  Vec3 to_shadow_map(const Vec3& position) const;
  float lit_share(const Vec3& position) const;

  Vec3 toward_sun_, axis_u_, axis_v_;
  double cell_m_;
  Vec2 low_ = Vec2::Zero();
  int width_ = 0, height_ = 0;
  std::vector<float> depth_m_;  ///< largest distance towards the sun in each cell
};

/// Bakes charts, lit by the sun, into one texture atlas (charts packed as rectangles with painted gutters) and
/// triangulates their grids. `texture_scale` multiplies the texels per metre. Degenerate cells are left out. Empty
/// input gives an empty mesh.
imaging::TexturedMesh bake_charts(const std::vector<const Chart*>& charts, const Sunlight& sun, double texture_scale);

}  // namespace tileflight::demo_place
