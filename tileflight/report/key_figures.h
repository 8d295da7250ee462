#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace tileflight::report {

/// A column of the table: one flight, as published or of this run.
struct FlightColumn {
  std::string key;    ///< "simulated" or "real"
  std::string label;  ///< "Simulated", "Real", "Surrogate", …
  bool published = false;
  nlohmann::json values;
};

/// A line of the table; `cells` in the order of the columns.
struct FigureRow {
  std::string label;
  std::vector<std::string> cells;
};

/// What the paper published beside what this run found.
struct KeyFigures {
  std::vector<FlightColumn> columns;
  std::vector<FigureRow> as_published;  ///< the rows of the paper's two tables
  std::vector<FigureRow> beyond;        ///< what puts them into perspective: floor, exact surface, trajectory
};

/// From results.json (contract's keys).
KeyFigures key_figures(const nlohmann::json& results);

/// What the second flight is called: "Surrogate" unless it is a video, and never "Real" unless it is.
std::string flight_label(const std::string& key, const nlohmann::json& flight);

/// One sentence: what the run found, and what it says about simulation predicting the second flight.
std::string verdict(const nlohmann::json& results);

}  // namespace tileflight::report
