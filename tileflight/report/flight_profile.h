#pragma once

#include <string>
#include <vector>

#include "tileflight/imaging/image.h"

namespace tileflight::report {

/// A flight over the way that it goes, a value each frame; NaN: none (nothing below, nothing near enough).
struct FlightProfile {
  std::string title;
  std::vector<std::string> notes;
  std::vector<double> along_m;         ///< way flown up to the frame
  std::vector<double> time_s;          ///< since the first frame
  std::vector<double> up_m;            ///< of the camera, local frame
  std::vector<double> above_ground_m;  ///< down to the first surface below
  std::vector<double> clearance_m;     ///< to the nearest surface
  std::vector<bool> troubled;          ///< inside, or the way to the next frame goes through a surface
  double near_m = 2.0;                 ///< a surface nearer than this is too near
  double reach_m = 100.0;              ///< clearances above this are not known, only that they are above
};

/// The camera's height with the ground below it, and under that the height above ground and the clearance.
imaging::RgbImage drawn(const FlightProfile& profile);

}  // namespace tileflight::report
