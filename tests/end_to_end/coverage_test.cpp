// Which tiles each strategy holds while a flight goes over a small place, and what its pictures then lack.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "tests/run_program.h"
#include "tests/source_folder.h"
#include "tests/test_data.h"
#include "tests/tiny_place.h"
#include "tileflight/core/imaging/image_files.h"

namespace tileflight::coverage_test {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using tests::file_text;
using tests::ProgramResult;
using tests::run_tileflight;
using tests::TinyPlace;

// Low over the place's western edge, looking east along the ground.
constexpr const char* kFlight = R"(camera: camera.yaml
fps: 5
speed_m_s: 4
max_frames: 12
waypoints:
  - {position: [-35, -10, 108], yaw_deg: 90, pitch_deg: -15}
  - {position: [-20, -10, 108], yaw_deg: 90, pitch_deg: -15}
)";

class Coverage : public ::testing::Test {
 protected:
  Coverage() {
    TinyPlace::write(folder_ / "place");
    TinyPlace::write_file(folder_ / "camera.yaml", TinyPlace::kCamera);
    TinyPlace::write_file(folder_ / "flight.yaml", kFlight);
  }

  ProgramResult run(const std::string& out, const std::vector<std::string>& more = {}) const {
    std::vector<std::string> call{
        "coverage", (folder_ / "place").string(), "--flight", (folder_ / "flight.yaml").string(),
        "--out",    (folder_ / out).string(),     "--json",   "--follow-height",
        "5"};
    call.insert(call.end(), more.begin(), more.end());
    return run_tileflight(call);
  }

  std::int64_t black_pixels(const std::string& picture) const {
    const imaging::RgbImage image = imaging::read_rgb(folder_ / "out" / (picture + ".png"));
    return std::count(image.pixels.begin(), image.pixels.end(), imaging::Rgb8{0, 0, 0});
  }

  tests::TemporaryFolder folder_;
};

TEST_F(Coverage, AFlightsOwnCutHasNoHolesAndAViewFromAboveHas) {
  const ProgramResult result = run("out");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const json coverage = json::parse(result.out);
  EXPECT_EQ(coverage, json::parse(file_text(folder_ / "out/coverage.json")));
  EXPECT_EQ(coverage["frames"], 12);
  const json& strategies = coverage["strategies"];
  for (const char* name : {"flight", "region"}) {
    EXPECT_EQ(strategies[name]["missing"], 0.0) << name;
    EXPECT_EQ(strategies[name]["missing_worst"], 0.0) << name;
    EXPECT_EQ(strategies[name]["right"], 1.0) << name;
    EXPECT_EQ(strategies[name]["cells_share"], 1.0) << name;
    EXPECT_EQ(strategies[name]["bytes_above"], fs::file_size(folder_ / "place/root.glb")) << name;
    EXPECT_EQ(black_pixels(name), 0) << name;
  }
  EXPECT_EQ(strategies["region"]["tiles"], 4);
  // Five metres above the drone, at 90 degrees, a viewer sees some 20 m around it.
  const json& follow = strategies["view-follow"];
  EXPECT_GT(follow["missing_worst"].get<double>(), 0.05);
  EXPECT_LT(follow["cells_share"].get<double>(), 0.8);
  EXPECT_GT(black_pixels("view-follow"), 1000);
  // A picture of 320 x 240 is counted as it is: what is black in it was said to be missing.
  const double black_share = static_cast<double>(black_pixels("view-follow")) / (320 * 240);
  EXPECT_LE(black_share, follow["missing_worst"].get<double>());
  EXPECT_GT(black_share, 0.3 * follow["missing_worst"].get<double>());
  EXPECT_EQ(tests::line_count(file_text(folder_ / "out/frames.csv")), 1 + 12 * 5);
  EXPECT_EQ(imaging::read_rgb(folder_ / "out/figure.png").width, 2 * 320 + 8);
}

TEST_F(Coverage, AViewFromHighAboveHasCoarseTilesOnly) {
  // From where the region fills the view, 4 m of error are some 100 pixels; with more allowed, the coarse tile will do.
  const json fine = json::parse(run("fine").out), coarse = json::parse(run("coarse", {"--viewer-error", "200"}).out);
  EXPECT_EQ(fine["strategies"]["view-high"]["right"], 1.0);
  EXPECT_EQ(coarse["strategies"]["view-high"]["tiles"], 1);
  EXPECT_EQ(coarse["strategies"]["view-high"]["missing"], 0.0);
  EXPECT_GT(coarse["strategies"]["view-high"]["coarser"].get<double>(), 0.9);
}

TEST_F(Coverage, SaysWhatIsAssumedOfAMissionAsAPreviewDoes) {
  TinyPlace::write_file(folder_ / "x.waypoints",
                        "QGC WPL 110\n0\t1\t0\t16\t0\t0\t0\t0\t47.0001\t8.0001\t500\t1\n"
                        "1\t0\t3\t16\t1\t0\t0\t0\t47.0001\t8.0001\t30\t1\n"
                        "2\t0\t10\t16\t1\t0\t0\t0\t46.9999\t7.9998\t20\t1\n");
  const auto call = [&](const std::string& command, const std::vector<std::string>& more) {
    std::vector<std::string> words{
        command, (folder_ / "place").string(), "--flight", (folder_ / "x.waypoints").string(), "--origin", "47,8,400",
        "--out", (folder_ / command).string()};
    words.insert(words.end(), more.begin(), more.end());
    const ProgramResult result = run_tileflight(words);
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return result.out;
  };
  const json preview = json::parse(call("preview", {"--json"}));
  const std::string printed = call("coverage", {"--frames", "3"});
  const json notes = json::parse(file_text(folder_ / "coverage/coverage.json"))["warnings"];
  EXPECT_THAT(notes, ::testing::Contains(::testing::ResultOf([](const json& note) { return note.get<std::string>(); },
                                                             ::testing::HasSubstr("take-off"))));
  for (const json& note : notes) {
    EXPECT_THAT(preview["warnings"], ::testing::Contains(note)) << note;
    EXPECT_THAT(printed, ::testing::HasSubstr("warning: " + note.get<std::string>()));
  }
  EXPECT_EQ(json::parse(run("out").out)["warnings"], json::array()) << "a FLIGHT file leaves nothing open";
}

TEST_F(Coverage, ThreadsChangeNothing) {
  ASSERT_EQ(run("one", {"--threads", "1"}).exit_code, 0);
  ASSERT_EQ(run("two", {"--threads", "2"}).exit_code, 0);
  for (const char* file : {"coverage.json", "frames.csv", "figure.png"})
    EXPECT_EQ(file_text(folder_ / "one" / file), file_text(folder_ / "two" / file)) << file;
}

// A quarter of the place takes some 0.37 MB: with 1.6 MB, two are kept and each is a scene of its own.
TEST_F(Coverage, InLittleMemoryTheSame) {
  ASSERT_EQ(run("whole").exit_code, 0);
  const ProgramResult parts = run("parts", {"--memory", "0.0016"});
  ASSERT_EQ(parts.exit_code, 0) << parts.err;
  for (const char* file : {"coverage.json", "frames.csv", "figure.png", "region.png"})
    EXPECT_EQ(file_text(folder_ / "whole" / file), file_text(folder_ / "parts" / file)) << file;
  const ProgramResult none = run("none", {"--memory", "0.0001"});
  EXPECT_EQ(none.exit_code, 1);
  EXPECT_THAT(none.err,
              ::testing::HasSubstr("this tile needs more than half of the memory limit: raise it (--memory)"));
  EXPECT_FALSE(fs::exists(folder_ / "none"));
}

TEST_F(Coverage, AFlightIsRenderedFromItsOwnCut) {
  const auto render = [&](const std::string& out, const std::vector<std::string>& more) {
    std::vector<std::string> call{
        "render", (folder_ / "place").string(), "--flight", (folder_ / "flight.yaml").string(),
        "--out",  (folder_ / out).string(),     "--json"};
    call.insert(call.end(), more.begin(), more.end());
    const ProgramResult result = run_tileflight(call);
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return json::parse(result.out);
  };
  const auto picture = [&](const std::string& out) { return file_text(folder_ / out / "images/000005.jpg"); };
  EXPECT_EQ(render("region", {"--center-local", "0,0,100", "--size", "80,80,20"})["tiles"], 4);
  EXPECT_EQ(render("flight", {})["tiles"], 4);
  EXPECT_TRUE(picture("flight") == picture("region"));
  EXPECT_EQ(render("coarse", {"--pixel-error", "1000"})["tiles"], 1);
  EXPECT_TRUE(picture("coarse") != picture("region"));
}

// A quarter of the place takes some 0.87 MB. From so high above, a frame needs at most two: those that it shows.
TEST_F(Coverage, AFlightThatDoesNotFitIntoMemoryIsRenderedInPartsAndNoPixelChanges) {
  TinyPlace::write_file(
      folder_ / "camera.yaml",
      "cam0: {camera_model: pinhole, intrinsics: [5600, 5600, 159.5, 119.5], distortion_model: radtan, "
      "distortion_coeffs: [0, 0, 0, 0], resolution: [320, 240]}\n");
  TinyPlace::write_file(folder_ / "flight.yaml", R"(camera: camera.yaml
fps: 4
speed_m_s: 10
waypoints:
  - {position: [-25, -20, 212], yaw_deg: 0, pitch_deg: -90}
  - {position: [25, -20, 212], yaw_deg: 0, pitch_deg: -90}
  - {position: [25, 20, 212], yaw_deg: 0, pitch_deg: -90}
)");
  const auto render = [&](const std::string& out, const std::string& memory_gb) {
    return run_tileflight({"render", (folder_ / "place").string(), "--flight", (folder_ / "flight.yaml").string(),
                           "--out", (folder_ / out).string(), "--memory", memory_gb, "--outputs",
                           "segmentation,infrared,flow", "--json"});
  };
  const ProgramResult whole = render("whole", "1"), parts = render("parts", "0.0019"), none = render("none", "0.0003");
  ASSERT_EQ(whole.exit_code, 0) << whole.err;
  ASSERT_EQ(parts.exit_code, 0) << parts.err;
  const json of_whole = json::parse(whole.out), of_parts = json::parse(parts.out);
  EXPECT_EQ(of_whole["parts"], 1);
  EXPECT_GE(of_parts["parts"], 2);
  EXPECT_LT(of_parts["triangles"], of_whole["triangles"]);
  for (const char* key : {"frames", "tiles", "complete", "path_length"}) EXPECT_EQ(of_parts[key], of_whole[key]) << key;
  EXPECT_EQ(of_whole["tiles"], 3);
  int files = 0;
  for (const auto& entry : fs::recursive_directory_iterator(folder_ / "whole")) {
    if (!entry.is_regular_file()) continue;
    const fs::path name = fs::relative(entry.path(), folder_ / "whole");
    EXPECT_TRUE(file_text(entry.path()) == file_text(folder_ / "parts" / name)) << name;
    ++files;
  }
  EXPECT_GT(files, 0);
  EXPECT_EQ(none.exit_code, 1);
  EXPECT_EQ(tests::line_count(none.err), 1) << none.err;
  EXPECT_THAT(none.err, ::testing::HasSubstr("more than 0.0003 GB of memory"));
  EXPECT_FALSE(fs::exists(folder_ / "none"));
}

TEST_F(Coverage, WhatCannotBeIsOneLine) {
  const auto error_of = [&](const std::string& flight, const std::vector<std::string>& more = {}) {
    TinyPlace::write_file(folder_ / "flight.yaml", flight);
    const ProgramResult result = run("bad", more);
    EXPECT_EQ(result.exit_code, 1);
    EXPECT_EQ(tests::line_count(result.err), 1) << result.err;
    EXPECT_FALSE(fs::exists(folder_ / "bad"));
    return result.err;
  };
  std::string away = kFlight;
  for (std::size_t at = away.find("pitch_deg: -15"); at != std::string::npos; at = away.find("pitch_deg: -15"))
    away.replace(at, 14, "pitch_deg: 80");
  for (std::size_t at = away.find(", 108]"); at != std::string::npos; at = away.find(", 108]"))
    away.replace(at, 6, ", 300]");
  EXPECT_THAT(error_of(away), ::testing::HasSubstr("sees no tile"));
  EXPECT_THAT(error_of(kFlight, {"--pixel-error", "0"}), ::testing::HasSubstr("--pixel-error: must be positive"));
  for (const char* name : {"root.glb", "0.glb", "1.glb", "2.glb", "3.glb"})
    TinyPlace::write_file(folder_ / "place" / name, TinyPlace::one_point_pnts());
  EXPECT_THAT(error_of(kFlight), ::testing::HasSubstr("contains only points"));
  fs::remove(folder_ / "place/2.glb");
  EXPECT_THAT(error_of(kFlight), ::testing::HasSubstr("2.glb"));
}

TEST(CoverageOfMachangara, TheFlightsCutIsWholeAndSmallerThanEverything) {
  TILEFLIGHT_REQUIRE_TEST_DATA(place, "tilesets/machangara_photogrammetry/tileset.json");
  const tests::TemporaryFolder folder;
  const fs::path flight = tests::source_folder() / "examples/machangara-flight-simulated.yaml";
  const ProgramResult result = run_tileflight({"coverage", place.string(), "--flight", flight.string(), "--out",
                                               (folder / "out").string(), "--json", "--frames", "5", "--width", "160"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const json coverage = json::parse(result.out);
  EXPECT_EQ(coverage["strategies"]["flight"]["missing"], 0.0);
  EXPECT_EQ(coverage["strategies"]["flight"]["right"], 1.0);
  EXPECT_EQ(coverage["strategies"]["region"]["missing"], 0.0);
  EXPECT_LT(coverage["strategies"]["flight"]["tiles"], coverage["strategies"]["region"]["tiles"]);
  EXPECT_GT(coverage["strategies"]["view-follow"]["missing"].get<double>(), 0.0);
}

}  // namespace
}  // namespace tileflight::coverage_test
