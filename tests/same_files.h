#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <set>
#include <string>

#include "tests/run_program.h"

namespace tileflight::tests {

/// All files below a folder, relative to it.
inline std::set<std::string> files_of(const std::filesystem::path& folder) {
  std::set<std::string> files;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    if (entry.is_regular_file()) files.insert(std::filesystem::relative(entry.path(), folder).string());
  }
  return files;
}

/// Expects the same files with the same bytes in both folders, but for the content of `differs`.
inline void expect_same_files(const std::filesystem::path& one, const std::filesystem::path& other,
                              const std::string& differs = "") {
  ASSERT_FALSE(files_of(one).empty());
  EXPECT_EQ(files_of(one), files_of(other));
  for (const std::string& file : files_of(one)) {
    if (file == differs) continue;
    EXPECT_TRUE(file_text(one / file) == file_text(other / file)) << other << " " << file;
  }
}

}  // namespace tileflight::tests
