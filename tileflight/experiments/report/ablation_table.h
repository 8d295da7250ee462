#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "tileflight/experiments/report/tables.h"

namespace tileflight::report {

/// Table of each variant's effect on the map and path, one row per variant; no rows if there are no variants.
Table ablation_table(const nlohmann::json& results);
/// Returns the table as plain text for a terminal; empty if there are no variants.
std::string ablation_text(const nlohmann::json& results);

}  // namespace tileflight::report
