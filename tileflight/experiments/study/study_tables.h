#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>

#include "tileflight/experiments/report/tables.h"

namespace tileflight::study {

/// Returns the ranking: score with its interval, robustness, medians of error, time and memory of each system.
report::Table ranking_table(const nlohmann::json& study);
/// Returns a table of the mean differences of all pairs of systems, with what chance may do.
report::Table differences_table(const nlohmann::json& study);
/// Returns a table of the distances that systems came before they failed.
report::Table survival_table(const nlohmann::json& study);
/// Returns the score of each system on each flight, mean over repetitions.
report::Table matrix_table(const nlohmann::json& study);
/// Returns a table with one row per run.
report::Table runs_table(const nlohmann::json& study);

/// Writes ranking, differences, survival, matrix and runs as CSV (RFC 4180) and LaTeX (booktabs) into the folder.
/// Throws InputError.
void write_study_tables(const nlohmann::json& study, const std::filesystem::path& folder);

}  // namespace tileflight::study
