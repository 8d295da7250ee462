// What goes wrong on a user's disk, staged: each is one clear line that names the culprit, exit 1, and nothing half
// written.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "tests/run_program.h"
#include "tests/tiny_place.h"

namespace tileflight::bad_input_test {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::AnyOf;
using ::testing::HasSubstr;
using tests::ProgramResult;
using tests::run_tileflight;
using tests::TinyPlace;

class BadInput : public ::testing::Test {
 protected:
  BadInput() { TinyPlace::write(folder_ / "place"); }

  fs::path tile(const std::string& name) const { return folder_ / "place" / name; }
  std::string tileset() const { return tile("tileset.json").string(); }
  std::string out() const { return (folder_ / "out").string(); }

  /// extract of the whole place, which must fail with one line that matches.
  template <class Matcher>
  void expect_extract_fails(const Matcher& matcher, const std::vector<std::string>& more = {}) const {
    std::vector<std::string> call{"extract", tileset(), "--out", out()};
    call.insert(call.end(), more.begin(), more.end());
    expect_fails(call, matcher);
  }

  template <class Matcher>
  void expect_fails(const std::vector<std::string>& call, const Matcher& matcher) const {
    const ProgramResult result = run_tileflight(call);
    EXPECT_EQ(result.exit_code, 1);
    EXPECT_EQ(tests::line_count(result.err), 1) << result.err;
    EXPECT_THAT(result.err, matcher);
    EXPECT_FALSE(fs::exists(out()));
    for (const auto& entry : fs::directory_iterator(folder_.path())) {
      EXPECT_THAT(entry.path().filename().string(), ::testing::Not(HasSubstr("out")))
          << "something half written is left";
    }
  }

  tests::TemporaryFolder folder_;
};

TEST_F(BadInput, AWholePlaceIsComplete) {
  const ProgramResult result = run_tileflight({"extract", tileset(), "--out", out(), "--json"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const auto extract = nlohmann::json::parse(result.out);
  EXPECT_TRUE(extract["complete"].get<bool>());
  EXPECT_EQ(extract["tiles_wanted"], 4);
  EXPECT_EQ(extract["tiles_loaded"], 4);
  EXPECT_EQ(extract["triangles"], 4 * 40 * 40 * 2);
  EXPECT_EQ(extract["attribution"], nlohmann::json({"Tiny Place, CC0"}));
  EXPECT_TRUE(extract["frame"]["origin_lat"].is_null());
  for (const char* file : {"mesh.glb", "surface.ply", "voxels.binvox", "voxels.ply", "octree.bt", "extract.json"}) {
    EXPECT_TRUE(fs::exists(fs::path(out()) / file)) << file;
  }
}

TEST_F(BadInput, MissingTileIsNamed) {
  fs::remove(tile("2.glb"));
  expect_extract_fails(HasSubstr("2.glb"));
}

TEST_F(BadInput, MissingTileMayBeAllowedAndThenTheResultIsIncomplete) {
  fs::remove(tile("2.glb"));
  const ProgramResult result = run_tileflight({"extract", tileset(), "--out", out(), "--allow-incomplete", "--json"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const auto extract = nlohmann::json::parse(result.out);
  EXPECT_FALSE(extract["complete"].get<bool>());
  EXPECT_EQ(extract["tiles_wanted"], 4);
  EXPECT_EQ(extract["tiles_loaded"], 3);
  EXPECT_EQ(extract["tiles_failed"], 1);
}

TEST_F(BadInput, TruncatedTileIsNamed) {
  fs::resize_file(tile("1.glb"), fs::file_size(tile("1.glb")) / 2);
  expect_extract_fails(HasSubstr("1.glb"));
}

TEST_F(BadInput, BrokenJsonIsNamed) {
  TinyPlace::write_file(tile("tileset.json"), R"({"asset": {"version": "1.1"}, "root": )");
  expect_extract_fails(HasSubstr("tileset.json"));
}

TEST_F(BadInput, CycleOfExternalTilesetsIsNamed) {
  nlohmann::json a = TinyPlace::tileset();
  a["root"]["children"][0]["content"]["uri"] = "b.json";
  nlohmann::json b = TinyPlace::tileset();
  b["root"]["children"][0]["content"]["uri"] = "tileset.json";
  TinyPlace::write_file(tile("tileset.json"), a.dump());
  TinyPlace::write_file(tile("b.json"), b.dump());
  expect_extract_fails(AllOf(HasSubstr("cycle"), HasSubstr(".json")));
}

TEST_F(BadInput, RegionOutsideThePlaceSaysWhereThePlaceIs) {
  expect_extract_fails(HasSubstr("region"), {"--center-local", "5000,0,100", "--size", "10,10,10"});
}

TEST_F(BadInput, GeographicRegionOfALocalPlaceIsRefused) {
  expect_extract_fails(HasSubstr("--center-local"), {"--center", "35.3,-80.7,200", "--size", "10,10,10"});
}

TEST_F(BadInput, NaNInATileIsNamed) {
  std::string bytes = tests::file_text(tile("3.glb"));
  const float nan = std::numeric_limits<float>::quiet_NaN();
  std::uint32_t json_length = 0;
  std::memcpy(&json_length, bytes.data() + 12, 4);
  std::memcpy(bytes.data() + 20 + json_length + 8 + 120, &nan, 4);
  TinyPlace::write_file(tile("3.glb"), bytes);
  expect_extract_fails(HasSubstr("3.glb"));
}

TEST_F(BadInput, ExistingOutputIsKept) {
  TinyPlace::write_file(out(), "mine");
  const ProgramResult result = run_tileflight({"extract", tileset(), "--out", out()});
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.err, HasSubstr("--force"));
  EXPECT_EQ(tests::file_text(out()), "mine");
}

TEST_F(BadInput, FolderThatCannotBeWrittenIsNamed) {
  const ProgramResult result = run_tileflight({"extract", tileset(), "--out", "/proc/tileflight/out"});
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_EQ(tests::line_count(result.err), 1) << result.err;
  EXPECT_THAT(result.err, HasSubstr("/proc/tileflight"));
}

TEST_F(BadInput, OutputThatDoesNotFitLeavesNothing) {
  // A limit on the size of files (64 KiB) stands for a full disk: the write fails in the middle.
  const ProgramResult result = run_tileflight({"extract", tileset(), "--out", out()}, "ulimit -f 64;");
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_EQ(tests::line_count(result.err), 1) << result.err;
  EXPECT_THAT(result.err, AnyOf(HasSubstr("too large"), HasSubstr("no space"), HasSubstr("cannot write")));
  EXPECT_EQ(std::distance(fs::directory_iterator(folder_.path()), fs::directory_iterator()), 1)
      << "only the place is there";
}

TEST_F(BadInput, PicturesOfAFlightThatDoNotFitLeaveNothing) {
  TinyPlace::write_file(folder_ / "camera.yaml", TinyPlace::kCamera);
  TinyPlace::write_file(folder_ / "flight.yaml",
                        "camera: camera.yaml\nfps: 5\nspeed_m_s: 5\nwaypoints:\n"
                        "  - {position: [-20, -10, 125], yaw_deg: 90, pitch_deg: -50}\n"
                        "  - {position: [20, 0, 125], yaw_deg: 90, pitch_deg: -50}\n");
  const ProgramResult result =
      run_tileflight({"render", tileset(), "--flight", (folder_ / "flight.yaml").string(), "--out", out()},
                     "ulimit -f 8;");  // KiB, less than a picture
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.err, AllOf(HasSubstr("images"), HasSubstr("cannot be written: File too large")));
  EXPECT_EQ(std::distance(fs::directory_iterator(folder_.path()), fs::directory_iterator()), 3)
      << "only the place, the camera and the flight are there";
}

TEST_F(BadInput, NoSpaceLeftOnStandardOutputIsAnError) {
  const std::string command = tests::shell_quoted(TILEFLIGHT_BINARY) + " inspect " + tests::shell_quoted(tileset()) +
                              " > /dev/full 2> " + tests::shell_quoted((folder_ / "err").string());
  EXPECT_EQ(WEXITSTATUS(std::system(command.c_str())), 1);
  EXPECT_EQ(tests::line_count(tests::file_text(folder_ / "err")), 1);
}

TEST_F(BadInput, UnknownKeyOfAnExperimentNamesTheNearest) {
  TinyPlace::write_file(folder_ / "e.yaml", "place: {source: place/tileset.json, centre_local: [0, 0, 100]}\n");
  expect_fails({"run", (folder_ / "e.yaml").string(), "--out", out()},
               AllOf(HasSubstr("e.yaml:1"), HasSubstr("center_local")));
}

}  // namespace
}  // namespace tileflight::bad_input_test
