#pragma once

#include <vector>

#include "tileflight/tiles/demo_place/chart.h"
#include "tileflight/tiles/demo_place/site_plan.h"

namespace tileflight::demo_place {

/// The parts of the built-in stadium as charts in the site frame. Each follows the plan and stands on the terrain; none
/// contains surfaces invisible from outside, except the few decimetres by which walls extend into the ground.
std::vector<Chart> make_ground(const SitePlan& plan, const Terrain& terrain, double tile_m);
std::vector<Chart> make_stands(const SitePlan& plan, const Terrain& terrain);
std::vector<Chart> make_buildings(const SitePlan& plan, const Terrain& terrain);
std::vector<Chart> make_trees(const SitePlan& plan, const Terrain& terrain);
std::vector<Chart> make_cars(const SitePlan& plan, const Terrain& terrain);
std::vector<Chart> make_furniture(const SitePlan& plan, const Terrain& terrain);

}  // namespace tileflight::demo_place
