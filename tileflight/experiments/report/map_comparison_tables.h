#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "tileflight/experiments/report/tables.h"

namespace tileflight::report {

// Tables and texts of the numbers that distinguish two maps (`comparison` of results.json: surface, completeness,
// path).

/// Returns whether the comparison has any of these numbers; otherwise it holds only the published measure.
bool has_map_comparison(const nlohmann::json& comparison);

/// Returns a table with one row per number: both values, the compared quantity (ratio or difference) with its interval,
/// the equivalence margin, and the result. It has no rows without data.
Table map_comparison_table(const nlohmann::json& results);

/// Areas that one map lacks and the other covers. No rows without data.
Table missing_parts_table(const nlohmann::json& results);

/// map_comparison_table() for a terminal, preceded by the verdict; empty without data.
std::string map_comparison_text(const nlohmann::json& results);

/// Returns a sentence such as "Simulation did not predict the surrogate flight's map: completeness at 0.2 m is 3.37
/// times the surrogate's (95 % interval 2.9 to 4.1; up to 1.02 counts as the same)". `second`: name of the second
/// flight.
std::string map_comparison_claim(const nlohmann::json& comparison, const std::string& second);

}  // namespace tileflight::report
