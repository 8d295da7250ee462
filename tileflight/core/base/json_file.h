#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>

namespace tileflight::base {

/// Reads a JSON file. Throws InputError (file) if it cannot be read or is not valid JSON.
nlohmann::json read_json(const std::filesystem::path& file);

}  // namespace tileflight::base
