#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "tileflight/report/tables.h"

namespace tileflight::report {

/// What each variant of the simulated flight does to its map and path, a row each; no rows if there are none.
Table ablation_table(const nlohmann::json& results);
/// The same as lines of text for a terminal; empty if there are none.
std::string ablation_text(const nlohmann::json& results);

}  // namespace tileflight::report
