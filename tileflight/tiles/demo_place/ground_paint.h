#pragma once

#include "tileflight/tiles/demo_place/chart.h"
#include "tileflight/tiles/demo_place/site_plan.h"

namespace tileflight::demo_place {

/// Returns the painter of the ground of one part of the plan: field, paving, streets with their markings, car parks,
/// lawns, woods.
Painter ground_painter(const SitePlan& plan, const Rect& part);

/// Returns the colour of the field with lines, hash marks, numbers and end zones (NCAA), and of the apron around it.
/// (x, y): site frame.
Color field_color(double x, double y, std::uint32_t seed);

/// Car park layout: bays are `kBayWidth_m` wide along x; a module of two rows of bays and a lane repeats along y.
inline constexpr double kBayWidth_m = 2.7, kBayDepth_m = 5.2, kLaneWidth_m = 6.1;
inline constexpr double kParkModule_m = 2 * kBayDepth_m + kLaneWidth_m;

/// Returns the colour of a car park. (x, y): site frame.
Color car_park_color(const CarPark& park, double x, double y);

}  // namespace tileflight::demo_place
