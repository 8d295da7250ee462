#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>

namespace tileflight::study {

/// study.html of a study's folder: one self-contained page that loads nothing. `study`: study.json. Pictures of the
/// worst runs are read from `folder`.
std::string study_page(const nlohmann::json& study, const std::filesystem::path& folder);

}  // namespace tileflight::study
