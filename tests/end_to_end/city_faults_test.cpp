// A broken tile in the middle of a place of many, and a disk that is full in the middle of a flight.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tests/refused_command.h"
#include "tests/render_command.h"
#include "tests/run_program.h"
#include "tests/same_files.h"
#include "tests/tiny_city.h"

namespace tileflight::city_faults_test {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using tests::ProgramResult;
using tests::run_tileflight;
using tests::TinyCity;
using tests::TinyPlace;

class CityFaults : public testing::Test {
 protected:
  CityFaults() {
    TinyCity::write(folder_ / "place");
    TinyPlace::write_file(folder_ / "camera.yaml", TinyPlace::kCamera);
    TinyPlace::write_file(folder_ / "flight.yaml", TinyCity::kFlight);
  }
  std::vector<std::string> render(const std::vector<std::string>& more) const {
    return tests::render_words(folder_.path(), "out", more);
  }
  /// Extracts nine blocks of 200 m; some of them are done before those that hold the broken tile.
  std::vector<std::string> extract(const std::vector<std::string>& more) const {
    std::vector<std::string> words{
        "extract", (folder_ / "place").string(), "--center-local", "0,-240,100", "--size", "600,590,60", "--voxel", "4",
        "--out",   (folder_ / "out").string()};
    words.insert(words.end(), more.begin(), more.end());
    return words;
  }

  tests::TemporaryFolder folder_;
  fs::path tile_ = folder_ / "place/t120.glb";  ///< of the finest level, under the flight's first leg
};

/// Returns ways to damage a GLB: its bytes end early, it is another file, or its header states wrong lengths.
std::map<std::string, std::function<void(std::string&)>> ways_to_break() {
  return {{"truncated", [](std::string& bytes) { bytes.resize(bytes.size() / 2); }},
          {"empty", [](std::string& bytes) { bytes.clear(); }},
          {"noise", [](std::string& bytes) { std::ranges::fill(bytes, '\x5a'); }},
          {"counts more than it has", [](std::string& bytes) { bytes.at(bytes.find("\"count\":") + 8) = '9'; }}};
}

TEST_F(CityFaults, ABrokenTileIsOneLineThatNamesIt) {
  const std::string whole = tests::file_text(tile_);
  for (const auto& [name, break_it] : ways_to_break()) {
    SCOPED_TRACE(name);
    std::string broken = whole;
    break_it(broken);
    ASSERT_NE(broken, whole);
    TinyPlace::write_file(tile_, broken);
    for (const auto& words :
         {render({"--memory", "1"}), render({"--memory", "0.0062"}), extract({}), extract({"--block", "200"})}) {
      tests::expect_one_line_refusal(run_tileflight(words), "t120.glb");
      EXPECT_FALSE(fs::exists(folder_ / "out"));
    }
  }
  const ProgramResult without = run_tileflight(render({"--allow-incomplete"}));
  ASSERT_EQ(without.exit_code, 0) << without.err;
  EXPECT_FALSE(nlohmann::json::parse(without.out)["complete"].get<bool>());
}

TEST_F(CityFaults, AFlightGoesOnAfterAFullDisk) {
  const std::vector<std::string> more{"--outputs", "depth", "--resume", "--threads", "1"};
  const std::vector<std::string> words = render(more);
  ASSERT_EQ(run_tileflight(words).exit_code, 0);
  fs::rename(folder_ / "out", folder_ / "whole");
  std::uintmax_t largest = 0;  // of the pictures
  for (const auto& file : fs::recursive_directory_iterator(folder_ / "whole")) {
    if (file.path().extension() == ".exr" || file.path().extension() == ".jpg")
      largest = std::max(largest, file.file_size());
  }
  // Files larger than this cannot be written: some frames can.
  const ProgramResult full = run_tileflight(words, "ulimit -f " + std::to_string(largest / 1024 - 1) + ";");
  tests::expect_one_line_refusal(full, "File too large");
  EXPECT_FALSE(fs::exists(folder_ / "out"));
  ASSERT_EQ(run_tileflight(words).exit_code, 0);
  tests::expect_same_files(folder_ / "whole", folder_ / "out");
}

}  // namespace
}  // namespace tileflight::city_faults_test
