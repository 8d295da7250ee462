#pragma once

#include <filesystem>
#include <system_error>

#include "tileflight/core/base/input_error.h"

namespace tileflight::base {

/// Makes a folder and its parents where they do not exist. Throws InputError.
inline void make_folder(const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) throw InputError(folder.string(), "cannot be made: " + error.message());
}

}  // namespace tileflight::base
