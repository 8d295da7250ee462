#pragma once

#include <vector>

#include "tileflight/tiling/chart.h"
#include "tileflight/tiling/site_plan.h"
#include "tileflight/tiling/terrain.h"

namespace tileflight::tiling {

/// The parts of the built-in stadium as charts in the site frame. Each follows the plan and stands on the terrain; none
/// holds surface that nobody can see from outside, beyond the few decimetres by which walls reach into the ground.
std::vector<Chart> make_ground(const SitePlan& plan, const Terrain& terrain, double tile_m);
std::vector<Chart> make_stands(const SitePlan& plan, const Terrain& terrain);
std::vector<Chart> make_buildings(const SitePlan& plan, const Terrain& terrain);
std::vector<Chart> make_trees(const SitePlan& plan, const Terrain& terrain);
std::vector<Chart> make_cars(const SitePlan& plan, const Terrain& terrain);
std::vector<Chart> make_furniture(const SitePlan& plan, const Terrain& terrain);

}  // namespace tileflight::tiling
