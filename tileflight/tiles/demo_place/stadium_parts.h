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

// Single objects, for other places, too.
/// Adds a tree that stands at `foot`.
void add_tree(const Tree& tree, const Vec3& foot, std::vector<Chart>& charts);
/// Adds a building on ground of the height `ground_m`.
void add_building(const Building& building, double ground_m, std::uint32_t seed, std::vector<Chart>& charts);
/// Makes a wall with recessed windows, seen from the right of `along`; `skirt_m` of it is below `corner`.
Chart make_wall(const Vec3& corner, const Vec3& along, double height_m, double skirt_m, BuildingStyle style,
                std::uint32_t seed);
/// Makes a random car whose centre stands at `foot`, its nose to +y.
Chart make_random_car(const Vec3& foot, std::uint32_t seed);

}  // namespace tileflight::demo_place
