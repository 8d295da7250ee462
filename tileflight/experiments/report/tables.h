#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "tileflight/core/drawing/html.h"
#include "tileflight/experiments/report/key_figures.h"
#include "tileflight/experiments/report/run_folder.h"

namespace tileflight::report {

/// A table of the page: a caption, a header, and rows whose first cell is the row's name.
struct Table {
  std::string caption;
  std::vector<std::string> header;
  std::vector<std::vector<std::string>> rows;
  std::vector<std::string> groups{};  ///< headings over equal numbers of columns after the first; may be empty
};
/// Returns the markup of a table; empty for a table without rows.
drawing::Html to_html(const Table& table);

/// The paper's table beside that of this run.
drawing::Html key_figures_table(const KeyFigures& figures);

// The tables of the page; without rows if the run has no data for them.

/// Percentiles of the distances, both flights.
Table percentiles_table(const std::vector<FlightRun>& flights);
/// Shares of points and of surface within each distance, both flights.
Table surface_table(const std::vector<FlightRun>& flights);
/// Tracking and alignment of the map, both flights.
Table tracking_table(const std::vector<FlightRun>& flights);
/// Errors of the estimated path, both flights.
Table trajectory_table(const std::vector<FlightRun>& flights);
/// Simulated against second flight.
Table comparison_table(const nlohmann::json& results);
/// Similarity of the simulated flight to the flight that it follows.
Table reproduction_table(const nlohmann::json& results);
/// The extracted ground truth of the place.
Table place_table(const nlohmann::json& results);
/// Coverage of the place by each tile loading strategy (docs/coverage.md).
Table coverage_table(const nlohmann::json& coverage);
/// Points and their errors in nine parts of the ground, both flights.
Table parts_table(const RunFolder& run);
/// Provenance of the numbers: program, command, inputs, time.
drawing::Html provenance_tables(const nlohmann::json& results);

}  // namespace tileflight::report
