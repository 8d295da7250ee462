#include "tileflight/tiles/demo_place/stadium.h"

#include <numbers>
#include <utility>

#include "tileflight/tiles/demo_place/stadium_parts.h"

namespace tileflight::demo_place {

SyntheticPlace make_stadium(std::uint32_t seed) {
  // Not aligned with the world's axes, so that no wall lies along a row of voxels.
  constexpr double kHeading_rad = 17.0 * std::numbers::pi / 180.0;
  const SitePlan plan = make_site_plan(seed);
  const Terrain terrain(plan);
  SyntheticPlace place{.half_m = kSiteHalf_m,
                       .charts = make_ground(plan, terrain, SyntheticPlace::kLeaf_m),
                       .origin = {kStadiumLatitudeDeg, kStadiumLongitudeDeg, {kStadiumHeightM}},
                       .heading_rad = kHeading_rad,
                       .attribution = "tileflight built-in stadium, CC0"};
  for (auto* make : {&make_stands, &make_buildings, &make_trees, &make_cars, &make_furniture})
    for (Chart& chart : (*make)(plan, terrain)) place.charts.push_back(std::move(chart));
  return place;
}

void write_stadium(const std::filesystem::path& folder, const PlaceOptions& options, const Progress& progress) {
  write_place(folder, PlaceKind::kStadium, options, progress);
}

}  // namespace tileflight::demo_place
