#pragma once

#include <filesystem>
#include <map>
#include <string>

namespace tileflight::dataset {

/// Read and format dataset.yaml: keys "a.b" are nested maps in the file, and list entries have their index as key.
std::map<std::string, std::string> read_metadata(const std::filesystem::path& file);
std::string format_metadata(const std::map<std::string, std::string>& about);

}  // namespace tileflight::dataset
