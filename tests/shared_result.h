#pragma once

#include <cstdlib>
#include <filesystem>
#include <functional>
#include <stdexcept>
#include <string>

#include "tests/temporary_folder.h"

namespace tileflight::tests {

/// A folder that takes long to make and from which several tests start. ctest runs every test as a process; the tests
/// SharedResults.* make each folder once for all of them, in TILEFLIGHT_SHARED_RESULTS (tests/CMakeLists.txt). Without
/// that variable each process makes what it needs.
struct SharedResult {
  std::string name;
  void (*make)(const std::filesystem::path& folder) = nullptr;  ///< throws if it fails

  /// For a test that changes it.
  void copy_to(const std::filesystem::path& folder) const {
    std::filesystem::create_directories(folder.parent_path());
    std::filesystem::copy(made(), folder, std::filesystem::copy_options::recursive);
  }

  /// For a test that only reads it.
  std::filesystem::path made() const {
    if (const char* shared = std::getenv("TILEFLIGHT_SHARED_RESULTS")) return std::filesystem::path(shared) / name;
    static const TemporaryFolder kOwn;
    if (!std::filesystem::exists(kOwn / name)) make(kOwn / name);
    return kOwn / name;
  }
};

}  // namespace tileflight::tests
