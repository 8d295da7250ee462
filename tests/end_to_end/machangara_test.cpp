// A real place and an independent flight: a drone survey of a ravine as 3D Tiles, and a video of a flight over it by
// another renderer.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "tests/run_program.h"
#include "tests/test_data.h"
#include "tileflight/core/geometry/trajectory.h"
#include "tileflight/evaluation/metrics/metrics.h"

namespace tileflight::machangara_test {
namespace {

using nlohmann::json;
using tests::ProgramResult;
using tests::run_tileflight;

TEST(Machangara, TheFinestCutIsWholeAndCounted) {
  TILEFLIGHT_REQUIRE_TEST_DATA(tileset, "tilesets/machangara_photogrammetry/tileset.json");
  const tests::TemporaryFolder folder;
  const ProgramResult result =
      run_tileflight({"extract", tileset.string(), "--out", (folder / "truth").string(), "--json"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const json extract = json::parse(result.out);
  EXPECT_TRUE(extract["complete"].get<bool>());
  EXPECT_EQ(extract["tiles_wanted"], 462);
  EXPECT_EQ(extract["tiles_loaded"], 462);
  EXPECT_EQ(extract["triangles_loaded"], 3029330);
  EXPECT_EQ(extract["geometric_error_max"], 0);
}

/// Plays a dataset from frame `from` on, forwards or backwards, and compares the path with the true one.
void expect_half_a_percent(const tests::TemporaryFolder& folder, const std::filesystem::path& flight, int from,
                           bool reverse) {
  const std::string out = (folder / ("odometry" + std::to_string(from))).string();
  std::vector<std::string> call{"odometry", (folder / "dataset").string(), "--out", out,
                                "--from",   std::to_string(from),          "--json"};
  if (reverse) call.push_back("--reverse");
  // The whole flight as it is by default; the others stand for themselves, without help from the other direction.
  if (from > 0) call.push_back("--no-check");
  const ProgramResult result = run_tileflight(call);
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const json odometry = json::parse(result.out);
  EXPECT_FALSE(odometry["lost"].get<bool>());
  EXPECT_EQ(odometry["frames"], 600 - from);
  EXPECT_GE(odometry["frames_tracked"].get<int>(), 600 - from - 5);
  const metrics::TrajectoryMetrics metrics = metrics::evaluate_trajectory(
      geometry::read_tum(std::filesystem::path(out) / "trajectory.txt"), geometry::read_tum(flight / "groundtruth.txt"),
      {.alignment = metrics::TrajectoryAlignment::kSim3});
  EXPECT_LE(metrics.ate_rmse_m, 0.005 * metrics.path_length_m);
}

TEST(MachangaraFlight, IsTrackedToHalfAPercentOfThePathFromEachStart) {
  TILEFLIGHT_REQUIRE_TEST_DATA(flight, "flights/machangara-a");
  const tests::TemporaryFolder folder;
  const ProgramResult result = run_tileflight(
      {"ingest", (flight / "video.mp4").string(), "--camera", (flight / "camera.yaml").string(), "--telemetry",
       (flight / "telemetry.srt").string(), "--telemetry-height", "ellipsoid", "--out", (folder / "dataset").string()});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  for (const auto& [from, reverse] : {std::pair(0, false), std::pair(330, false), std::pair(240, true)}) {
    SCOPED_TRACE(from);
    expect_half_a_percent(folder, flight, from, reverse);
  }
}

}  // namespace
}  // namespace tileflight::machangara_test
