#pragma once

#include <functional>
#include <vector>

#include "tileflight/core/base/noise.h"
#include "tileflight/tiles/demo_place/chart.h"
#include "tileflight/tiles/demo_place/site_plan.h"
#include "tileflight/tiles/demo_place/synthetic_place.h"

namespace tileflight::demo_place {

/// The ground of a place, in the site frame.
struct Landscape {
  std::function<double(double x, double y)> height_m;
  std::function<Color(const Texel&)> paint;
  std::vector<Rect> holes;  ///< no ground there: what stands on it hides it
  double texel_m = 0.07;

  Vec3 point(double x, double y) const { return {x, y, height_m(x, y)}; }
};

/// Begins a place with its ground, in cells of a metre. The heading comes from the seed.
SyntheticPlace make_place_on(const Landscape& land, std::uint32_t seed);

/// Turns charts about the vertical (counter-clockwise from above) and moves them, with their paint.
void move_charts(std::vector<Chart>& charts, double angle_rad, const Vec3& by);

/// Appends charts.
void append(std::vector<Chart> more, std::vector<Chart>& charts);

/// Returns a painter of one material by the position on a chart.
Painter painted(Color (*material)(double, double, std::uint32_t), std::uint32_t seed);

/// Adds a box that stands on `foot`, the middle of its floor.
void add_box(const Vec3& foot, const Vec3& size, double angle_rad, const Painter& wall, const Painter& roof,
             std::vector<Chart>& charts);

/// A house with a gable roof, whose ridge runs along its width.
struct House {
  Vec2 center = Vec2::Zero();
  double angle_rad = 0.0;  ///< of its width, counter-clockwise from x
  double width_m = 8.0, depth_m = 8.0;
  double eaves_m = 6.0, rise_m = 3.0;  ///< above the ground; of the ridge above the eaves
  BuildingStyle style = BuildingStyle::kPlaster;
  std::uint32_t seed = 0;

  /// Returns the largest upright rectangle about its middle that it hides.
  Rect hidden() const;
};

/// Adds a house with its chimney; its walls reach a metre below `ground_m`.
void add_house(const House& house, double ground_m, std::vector<Chart>& charts);

/// Adds trees at random where `may_stand` allows, crowns apart. `kind_of` draws a tree for a position.
void plant(const Landscape& land, int tries, const std::function<bool(const Vec2&)>& may_stand,
           const std::function<Tree(const Vec2&, base::HashRandom&)>& kind_of, std::uint32_t seed,
           std::vector<Chart>& charts);

/// Draws a tree of a garden or park: broadleaf, some bushes and conifers.
Tree draw_tree(const Vec2& at, base::HashRandom& random);

// The places, each of a seed.
SyntheticPlace make_town(std::uint32_t seed);
SyntheticPlace make_suburb(std::uint32_t seed);
SyntheticPlace make_ravine(std::uint32_t seed);
SyntheticPlace make_works(std::uint32_t seed);
SyntheticPlace make_woods(std::uint32_t seed);
SyntheticPlace make_fort(std::uint32_t seed);

}  // namespace tileflight::demo_place
