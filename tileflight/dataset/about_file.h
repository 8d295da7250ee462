#pragma once

#include <filesystem>
#include <map>
#include <string>

namespace tileflight::dataset {

/// dataset.yaml: keys "a.b" are nested maps in the file. List entries get their position as key.
std::map<std::string, std::string> read_about(const std::filesystem::path& file);
std::string about_text(const std::map<std::string, std::string>& about);

}  // namespace tileflight::dataset
