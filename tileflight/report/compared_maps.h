#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "tileflight/report/tables.h"

namespace tileflight::report {

// Two maps by the numbers that tell them apart (`comparison` of results.json: surface, completeness, path), for people.

/// Whether the comparison has any of them; else it is the published measure's alone.
bool has_compared_maps(const nlohmann::json& comparison);

/// A row a number: both values, what is judged (a ratio or a difference) with its interval, what counts as the same,
/// and what came out. `second`: what the second flight is called. Without rows where there is nothing.
Table compared_maps_table(const nlohmann::json& results);

/// Where one map lacks what the other has. Without rows where there is nothing.
Table missing_parts_table(const nlohmann::json& results);

/// compared_maps_table() for a terminal, with the verdict above; empty where there is nothing.
std::string compared_maps_text(const nlohmann::json& results);

/// "Simulation did not predict the surrogate flight's map: completeness at 0.2 m is 3.37 times the surrogate's (95 %
/// interval 2.9 to 4.1; up to 1.02 counts as the same)".
std::string compared_maps_claim(const nlohmann::json& comparison, const std::string& second);

}  // namespace tileflight::report
