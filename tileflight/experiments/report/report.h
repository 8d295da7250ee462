#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "tileflight/experiments/report/view_data.h"

namespace tileflight::report {

/// Options of write_report().
struct ReportOptions {
  ViewBudget view;  ///< size limits of the interactive view
};

/// Builds `run_folder/report.html` from the results in a run folder (docs/formats.md): one self-contained page that
/// loads nothing and runs only the script of its view, and beside it `report.json`, `figures/` and `tables/`
/// (docs/report.md). Missing parts of the folder (a flight, a truth, a map) are left out and named on the page. Throws
/// InputError if results.json is missing or not a JSON object, or an existing part is malformed.
void write_report(const std::filesystem::path& run_folder, const ReportOptions& options = {});

/// Whether a folder holds trajectories scored alone (trajectory-errors.json, docs/formats.md) and no run.
bool holds_trajectories_alone(const std::filesystem::path& folder);

/// Builds `folder/report.html` and `folder/figures/` from the metrics.json and trajectory-errors.json of trajectories
/// scored alone: their errors as tables, their paths from above and from the side, errors over time and distance, and
/// relative errors. One self-contained page. Throws InputError if a file is missing or malformed.
void write_trajectory_report(const std::filesystem::path& folder);

/// The first table of the page as plain text for a terminal: the paper's columns beside those of this run.
std::string results_table(const nlohmann::json& results);

}  // namespace tileflight::report
