// The odometry command on a flight whose truth is known: what it writes, and what its options change.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "tests/run_program.h"
#include "tests/tiny_flight.h"
#include "tileflight/core/base/output_folder.h"
#include "tileflight/core/geometry/cloud_files.h"
#include "tileflight/core/imaging/image_files.h"
#include "tileflight/evaluation/metrics/metrics.h"

namespace tileflight::odometry_command_test {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using tests::ProgramResult;
using tests::run_tileflight;
using tests::TinyFlight;

class OdometryCommand : public ::testing::Test {
 protected:
  OdometryCommand() { TinyFlight::copy_to(dataset_); }

  json run(const std::string& out, std::vector<std::string> more = {}) const {
    std::vector<std::string> call{"odometry", dataset_.string(), "--out", (folder_ / out).string(), "--json"};
    call.insert(call.end(), more.begin(), more.end());
    const ProgramResult result = run_tileflight(call);
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return result.exit_code == 0 ? json::parse(result.out) : json::object();
  }

  double ate_share(const std::string& out,
                   metrics::TrajectoryAlignment alignment = metrics::TrajectoryAlignment::kSim3) const {
    const auto metrics = metrics::evaluate_trajectory(geometry::read_tum(folder_ / out / "trajectory.txt"),
                                                      TinyFlight::truth(), {.alignment = alignment});
    return metrics.ate_rmse_m / metrics.path_length_m;
  }

  tests::TemporaryFolder folder_;
  fs::path dataset_ = folder_ / "dataset";
};

TEST_F(OdometryCommand, IsTheSameOnOneAndTwoThreads) {
  run("one", {"--deterministic", "--threads", "1"});
  run("two", {"--threads", "2"});
  for (const char* file : {"trajectory.txt", "keyframes.txt", "map.ply", "camera.yaml"}) {
    EXPECT_EQ(tests::file_text(folder_ / "one" / file), tests::file_text(folder_ / "two" / file)) << file;
  }
  EXPECT_LT(ate_share("one"), 0.005);
}

TEST_F(OdometryCommand, RectifiesForComparison) {
  const json about = run("rectified", {"--rectify", "90", "--fixed-intrinsics"});
  EXPECT_FALSE(about["intrinsics"]["estimated"].get<bool>());
  EXPECT_GE(about["frames_tracked"].get<int>(), TinyFlight::kFrames - 3);
  EXPECT_LT(ate_share("rectified"), 0.01);
  const imaging::Camera camera = imaging::read_calibration(folder_ / "rectified/camera.yaml").camera;
  EXPECT_NEAR(camera.horizontal_fov_deg(), 90.0, 1e-9);
  EXPECT_TRUE(std::holds_alternative<imaging::PinholeRadtan>(camera.model()));
}

TEST_F(OdometryCommand, StartsFromKnownPosesInTheirFrameAndScale) {
  geometry::write_tum(folder_ / "known.txt", TinyFlight::truth());
  run("known", {"--init-from", (folder_ / "known.txt").string()});
  const auto estimate = geometry::read_tum(folder_ / "known/trajectory.txt");
  const auto truth = TinyFlight::truth();
  ASSERT_FALSE(estimate.empty());
  const auto pairs = geometry::associate(estimate, truth);
  ASSERT_FALSE(pairs.empty());
  for (const auto& [ours, theirs] : pairs) {
    EXPECT_LT((estimate.poses[ours].T_local_camera.translation - truth.poses[theirs].T_local_camera.translation).norm(),
              0.04 * geometry::path_length_m(truth));
  }
  run("reversed", {"--reverse", "--init-from", (folder_ / "known.txt").string()});
  int compared = 0;
  for (const geometry::StampedPose& pose : geometry::read_tum(folder_ / "reversed/trajectory.txt").poses) {
    const auto expected = geometry::interpolate(truth, pose.time_s);
    if (expected) {
      ++compared;
      EXPECT_LT((pose.T_local_camera.translation - expected->translation).norm(),
                0.04 * geometry::path_length_m(truth));
    }
  }
  EXPECT_GT(compared, 0);
}

TEST_F(OdometryCommand, WritesColmapAndDebugPictures) {
  const json about = run("out", {"--colmap", "--debug-pictures", (folder_ / "pictures").string()});
  EXPECT_THAT(tests::file_text(folder_ / "out/colmap/cameras.txt"), testing::HasSubstr("OPENCV_FISHEYE 280 180"));
  EXPECT_EQ(tests::line_count(tests::file_text(folder_ / "out/colmap/points3D.txt")), 1 + about["points"].get<int>());
  EXPECT_EQ(tests::line_count(tests::file_text(folder_ / "out/colmap/images.txt")),
            2 + 2 * about["keyframes"].get<int>());
  const std::vector<std::string> pictures = base::read_folder_marker(folder_ / "pictures")->files;
  EXPECT_EQ(pictures.size(), about["keyframes"].get<std::size_t>());
  const imaging::RgbImage first = imaging::read_rgb(folder_ / "pictures" / pictures.front());
  EXPECT_EQ(first.width, 280);
}

TEST_F(OdometryCommand, FiltersOfTheMapAreOptions) {
  const json all = run("all");
  // Few keyframes leave the window of so short a flight; what further points are worth is tested beside the code.
  EXPECT_LE(run("active", {"--active-points-only"})["points"].get<int>(), all["points"].get<int>());
  const json strict = run("strict", {"--min-observations", "5", "--max-deviation", "0.01", "--min-parallax", "3"});
  EXPECT_LT(strict["points"].get<int>(), all["points"].get<int>());
  const geometry::PointCloud map = geometry::read_cloud(folder_ / "strict/map.ply");
  for (const float observations : map.scalars.at("observations")) EXPECT_GE(observations, 5);
  EXPECT_EQ(tests::file_text(folder_ / "all/trajectory.txt"), tests::file_text(folder_ / "strict/trajectory.txt"));
}

}  // namespace
}  // namespace tileflight::odometry_command_test
