#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace tileflight::dataset {

/// When a camera of a rig took its pictures.
struct CameraTimes {
  std::string name;
  std::vector<double> times_s;  ///< on the body's clock, increasing; not empty
};

/// How a camera's pictures go with those of the rig's first camera.
struct CameraSynchronisation {
  std::string name;
  std::size_t frames = 0;
  std::size_t pairs = 0;      ///< pictures of the slower of the two that may have a partner: the other one runs, too
  std::size_t matched = 0;    ///< those of them with a partner within the tolerance
  double largest_skew_s = 0;  ///< between the two pictures of a matched pair
  double offset_s = 0;        ///< median over `pairs`: the nearest picture of this camera is later by so much
  std::size_t missing = 0;    ///< pictures that it should have taken while it ran, and did not
  double starts_late_s = 0;   ///< after the camera that starts first; 0 within a period and a half
  double stops_early_s = 0;   ///< before the camera that stops last; 0 within a period and a half
};

/// Of all cameras, in their order; the first one is matched with itself.
struct Synchronisation {
  std::vector<CameraSynchronisation> cameras;
  double tolerance_s = 0;
  std::vector<std::string> faults;  ///< one line each: what is wrong, and what can be done
};

/// Checks the times of a rig's pictures. A camera is not synchronised with the first if fewer than half of the pairs
/// match, or if it begins and ends later (or earlier) by the same time with as many pictures: an offset of whole
/// frames, which no pair shows. A picture is missing where another camera of the same rate has one and this camera has
/// none or, if no other has its rate, where its own times have a gap of more than a period and a half. Throws
/// InputError(name, cause) if a camera never runs together with the first.
Synchronisation check_synchronisation(const std::vector<CameraTimes>& cameras, double tolerance_s);

}  // namespace tileflight::dataset
