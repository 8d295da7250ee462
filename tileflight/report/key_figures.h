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

/// "surrogate", for the middle of a sentence.
std::string lower_case(std::string label);

/// What a reader must know of the table's first rows; empty if there is nothing to say.
std::string remark_on_floor(const nlohmann::json& results);

/// Whether simulation predicted the second flight's map, by which numbers, and the published means beside. No verdict
/// where a doubt forbids it: then what forbids it.
std::string verdict(const nlohmann::json& results);

}  // namespace tileflight::report
