#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace tileflight::report {

/// A column of the table: one flight, either as published or of this run.
struct FlightColumn {
  std::string key;    ///< "simulated" or "real"
  std::string label;  ///< "Simulated", "Real", "Surrogate", …
  bool published = false;
  nlohmann::json values;
};

/// A row of the table; `cells` are in the order of the columns.
struct KeyFigureRow {
  std::string label;
  std::vector<std::string> cells;
};

/// The paper's published results beside those of this run.
struct KeyFigures {
  std::vector<FlightColumn> columns;
  std::vector<KeyFigureRow> as_published;  ///< the rows of the paper's two tables
  std::vector<KeyFigureRow> additional;    ///< context: quantization floor, exact surface, trajectory
};

/// Extracts the figures from results.json (the contract's keys).
KeyFigures key_figures(const nlohmann::json& results);

/// Name of a flight: the second one is "Surrogate" unless it is a video, and only a video is "Real".
std::string flight_label(const std::string& key, const nlohmann::json& flight);

/// A remark on the table's first rows that readers need; may be empty.
std::string remark_on_floor(const nlohmann::json& results);

/// States whether simulation predicted the second flight's map, with the numbers that decide it and the published
/// means. If a warning prevents a verdict, names that warning instead.
std::string verdict(const nlohmann::json& results);

/// The table of key figures as CSV (RFC 4180, UTF-8): one column per flight, named by source and flight; numbers as on
/// the page; empty fields for unknown values.
std::string key_figures_csv(const KeyFigures& figures);

/// The table as a LaTeX tabular with booktabs rules, to be \input into a table environment.
std::string key_figures_latex(const KeyFigures& figures);

/// Escapes plain text (UTF-8) for LaTeX: special characters are escaped, the page's typographic ones become commands.
std::string latex_text(const std::string& plain);

/// Writes `key-figures.csv` and `key-figures.tex` into the folder, creating it if necessary. Throws InputError.
void write_key_figures(const std::filesystem::path& folder, const KeyFigures& figures);

}  // namespace tileflight::report
