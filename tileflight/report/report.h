#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "tileflight/report/view_data.h"

namespace tileflight::report {

struct ReportOptions {
  ViewBudget view;  ///< what the interactive view may take
};

/// Builds `run_folder/report.html` from what an experiment left in the folder (docs/formats.md): one page that holds
/// everything it shows, loads nothing and runs only the script of its view; beside it `report.json`, `figures/` and
/// `tables/` (docs/report.md). Parts of the folder that are missing (a flight, a truth, a
/// map) are left out and named on the page. Throws InputError when results.json is missing or no JSON object, or a part
/// that is there is malformed.
void write_report(const std::filesystem::path& run_folder, const ReportOptions& options = {});

/// The table that the page begins with, as plain text for a terminal: the paper's columns beside those of this run.
std::string results_table(const nlohmann::json& results);

}  // namespace tileflight::report
