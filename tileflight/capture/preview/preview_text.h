#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>

namespace tileflight::preview {

/// A readable summary of preview.json, written to the folder `out`.
std::string preview_text(const nlohmann::json& found, const std::filesystem::path& out);

}  // namespace tileflight::preview
