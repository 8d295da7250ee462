#pragma once

#include <string>
#include <vector>

#include "tileflight/core/imaging/image.h"

namespace tileflight::drawing {

/// A flight along its path, one value per frame; NaN: none (nothing below, or nothing within range).
struct FlightProfile {
  std::string title;
  std::vector<std::string> notes;
  std::vector<double> distance_flown_m;  ///< path length up to the frame
  std::vector<double> time_s;            ///< since the first frame
  std::vector<double> up_m;              ///< of the camera, local frame
  std::vector<double> above_ground_m;    ///< vertical distance to the first surface below
  std::vector<double> clearance_m;       ///< to the nearest surface
  std::vector<bool> in_collision;        ///< camera inside a surface, or the segment to the next frame intersects one
  double min_clearance_m = 2.0;          ///< clearances below this are marked as too small
  double max_clearance_m = 100.0;        ///< search limit: larger clearances are only known to exceed it
};

/// Plots the camera's height with the ground below it, and beneath that the height above ground and the clearance.
imaging::RgbImage draw_to_image(const FlightProfile& profile);

}  // namespace tileflight::drawing
