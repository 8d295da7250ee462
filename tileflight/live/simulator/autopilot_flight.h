#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "tileflight/capture/flight_path/path.h"
#include "tileflight/capture/recording/flown_path.h"
#include "tileflight/capture/vehicle/autopilot_plan.h"
#include "tileflight/live/simulator/simulator.h"

namespace tileflight::simulator {

/// A flight by an autopilot; times are from its first step.
struct AutopilotFlight {
  flight_path::Path path;   ///< of the camera, from 0 s
  std::string outcome;      ///< "landed" or "time is over"
  double airborne_s = 0.0;  ///< time of take-off; 0: it stayed on the ground
  std::int64_t steps = 0;   ///< of the autopilot
  GeoPoint home;
  std::vector<std::string> lines;  ///< the simulator's messages: lost vision, damaged packets; at most 51
};

/// Flies an autopilot's vehicle over a place until it has landed and its motors have been off for half a second, or the
/// plan's time is over. `options`: source, tiles and limits; the rest is set here. The same packets give the same path.
/// Throws InputError if the autopilot's command ends or falls silent early, or never makes a step.
AutopilotFlight fly_autopilot(const vehicle::AutopilotPlan& plan, SimulatorOptions options,
                              const Progress& progress = {});

/// Flies the autopilot of a flight plan among the tiles that the settings choose for images: the AutopilotFlyer of
/// `render`. Throws InputError as fly_autopilot() does.
recording::FlownPath render_autopilot_flight(const vehicle::FlightPlan& plan, const recording::RenderSettings& settings,
                                             const Progress& progress);

}  // namespace tileflight::simulator
