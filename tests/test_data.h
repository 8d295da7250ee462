#pragma once

#include <cstdlib>
#include <filesystem>
#include <string>

#include "tests/source_folder.h"

namespace tileflight::tests {

/// Folder of the real tilesets and flights: $TILEFLIGHT_TEST_DATA, else ../shared/data beside the repository.
inline std::filesystem::path test_data_root() {
  if (const char* folder = std::getenv("TILEFLIGHT_TEST_DATA")) return folder;
  return source_folder() / ".." / "shared" / "data";
}

}  // namespace tileflight::tests

/// Declares `VARIABLE` as the path of `RELATIVE` in the test data; skips the test where it is absent.
#define TILEFLIGHT_REQUIRE_TEST_DATA(VARIABLE, RELATIVE)                                   \
  const std::filesystem::path VARIABLE = tileflight::tests::test_data_root() / (RELATIVE); \
  if (!std::filesystem::exists(VARIABLE)) GTEST_SKIP() << "TILEFLIGHT_TEST_DATA has no " << (RELATIVE)
