#pragma once

#include <nlohmann/json_fwd.hpp>
#include <vector>

#include "tileflight/experiments/report/run_folder.h"
#include "tileflight/experiments/report/tables.h"

namespace tileflight::report {

// Tables of optional scores; without rows if the run has none.

/// Distances over the regions used for the alignment and over those held out, both flights.
Table regions_table(const std::vector<FlightRun>& flights);
/// Consistency of normals, map entropy and drift, both flights.
Table quality_table(const std::vector<FlightRun>& flights);
/// Error budget of the distance to the surface, both flights.
Table budget_table(const std::vector<FlightRun>& flights);
/// Points on moving objects, which are in no other score, both flights.
Table moving_table(const std::vector<FlightRun>& flights);
/// Each repeated odometry run, and their spread.
Table runs_table(const std::vector<FlightRun>& flights);
/// Predictions of the simulated flight about the frames that the other one lost and the places it missed.
Table failure_table(const nlohmann::json& results);

}  // namespace tileflight::report
