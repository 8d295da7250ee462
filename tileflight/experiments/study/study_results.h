#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>

namespace tileflight::study {

/// Returns whether `folder` is that of a study (holds plan.json).
bool is_study_folder(const std::filesystem::path& folder);

/// Gathers the results of all runs of a study's folder into study.json (docs/formats.md), which is returned. Runs that
/// have not ended have the reason "not run yet". Throws InputError if the folder is no study's.
nlohmann::json collect_study(const std::filesystem::path& folder);

/// Writes study.json, study.html and tables/ (CSV and LaTeX) into a study's folder, and returns study.json.
nlohmann::json write_study_report(const std::filesystem::path& folder);

}  // namespace tileflight::study
