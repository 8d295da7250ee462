#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tileflight/report/html.h"
#include "tileflight/report/key_figures.h"
#include "tileflight/report/run_folder.h"

namespace tileflight::report {

/// A table of the page: a caption, a head, and rows whose first cell names them.
struct Table {
  std::string caption;
  std::vector<std::string> head;
  std::vector<std::vector<std::string>> rows;
  std::vector<std::string> groups{};  ///< over equal numbers of columns, all but the first; may be empty
};
/// Empty markup for a table without rows.
Html draw(const Table& table);

/// The paper's table with ours beside.
Html key_figures_table(const KeyFigures& figures);

// The tables of the page; without rows where the run holds nothing for them.

/// Percentiles of the distances, both flights.
Table percentiles_table(const std::vector<FlightRun>& flights);
/// Shares of points and surface within each distance, both flights.
Table surface_table(const std::vector<FlightRun>& flights);
/// How the map was tracked and aligned, both flights.
Table tracking_table(const std::vector<FlightRun>& flights);
/// Errors of the estimated path, both flights.
Table trajectory_table(const std::vector<FlightRun>& flights);
/// Simulated against second flight.
Table comparison_table(const nlohmann::json& results);
/// How like the flight that it follows the simulated one is.
Table reproduction_table(const nlohmann::json& results);
/// What was loaded of the place as ground truth.
Table place_table(const nlohmann::json& results);
/// What each way of loading tiles shows of the place (docs/coverage.md).
Table coverage_table(const nlohmann::json& coverage);
/// Points and their errors in nine parts of the ground, both flights.
Table parts_table(const RunFolder& run);
/// Where the numbers come from: program, command, inputs, time.
Html provenance_tables(const nlohmann::json& results);

}  // namespace tileflight::report
