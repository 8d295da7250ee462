#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tests/run_program.h"

namespace tileflight::tests {

/// Words of `render` of the tiles in FOLDER/place along FOLDER/flight.yaml into FOLDER/`out`.
inline std::vector<std::string> render_words(const std::filesystem::path& folder, const std::string& out,
                                             const std::vector<std::string>& more) {
  std::vector<std::string> words{"render", (folder / "place").string(), "--flight", (folder / "flight.yaml").string(),
                                 "--out",  (folder / out).string(),     "--json"};
  words.insert(words.end(), more.begin(), more.end());
  return words;
}

/// Runs it; what it says, or null after a failed expectation if it fails.
inline nlohmann::json render_json(const std::filesystem::path& folder, const std::string& out,
                                  const std::vector<std::string>& more) {
  const ProgramResult result = run_tileflight(render_words(folder, out, more));
  EXPECT_EQ(result.exit_code, 0) << result.err;
  return result.exit_code == 0 ? nlohmann::json::parse(result.out) : nlohmann::json();
}

}  // namespace tileflight::tests
