#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

namespace tileflight::report {

/// Builds `run_folder/report.html` from what an experiment left in the folder (docs/formats.md): one page that holds
/// everything it shows, loads nothing and runs no script. Parts of the folder that are missing (a flight, a truth, a
/// map) are left out and named on the page. Throws InputError when results.json is missing or no JSON object, or a part
/// that is there is malformed.
void write_report(const std::filesystem::path& run_folder);

/// The table that the page begins with, as plain text for a terminal: the paper's columns beside those of this run.
std::string results_table(const nlohmann::json& results);

}  // namespace tileflight::report
