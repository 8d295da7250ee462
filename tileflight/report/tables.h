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
Html draw(const Table& table);

/// The paper's table with ours beside.
Html key_figures_table(const KeyFigures& figures);

/// Percentiles of the distances, both flights; empty markup if no flight has any.
Html percentiles_table(const std::vector<FlightRun>& flights);
/// Shares of points and surface within each distance, both flights.
Html surface_table(const std::vector<FlightRun>& flights);
/// How the map was tracked and aligned, both flights.
Html tracking_table(const std::vector<FlightRun>& flights);
/// Errors of the estimated path, both flights.
Html trajectory_table(const std::vector<FlightRun>& flights);
/// Simulated against second flight; empty markup if the run has no comparison.
Html comparison_table(const nlohmann::json& results);
/// How like the flight that it follows the simulated one is; empty markup if it follows none.
Html reproduction_table(const nlohmann::json& results);
/// Where the numbers come from: program, command, inputs, time.
Html provenance_tables(const nlohmann::json& results);

}  // namespace tileflight::report
