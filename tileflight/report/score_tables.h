#pragma once

#include <nlohmann/json.hpp>
#include <vector>

#include "tileflight/report/run_folder.h"
#include "tileflight/report/tables.h"

namespace tileflight::report {

// Tables of scores that not every run has; without rows where it has none.

/// Distances over the regions that the alignment was made on, and over those held back from it, both flights.
Table regions_table(const std::vector<FlightRun>& flights);
/// Normals' consistency, map entropy and drift, both flights.
Table quality_table(const std::vector<FlightRun>& flights);
/// What makes up the distance to the surface, both flights.
Table budget_table(const std::vector<FlightRun>& flights);
/// Each of the repeated runs of odometry, and their spread.
Table runs_table(const std::vector<FlightRun>& flights);
/// What the simulated flight said of the frames that the other one lost, and of the places that it missed.
Table failure_table(const nlohmann::json& results);

}  // namespace tileflight::report
