#include "tileflight/evaluation/scoring/map_inputs.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "tests/refusal.h"
#include "tests/temporary_folder.h"
#include "tileflight/data/dataset/dataset.h"
#include "tileflight/data/exports/export_dataset.h"
#include "tileflight/evaluation/scoring/evaluate_trajectories.h"

namespace tileflight::scoring::map_inputs_test {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using tests::refusal_of;

class MapInputsOfAFlight : public testing::Test {
 protected:
  MapInputsOfAFlight() {
    fs::create_directories(folder_ / "odometry");
    for (int i = 0; i < 3; ++i)
      truth_.poses.push_back(
          {1403636579.5 + 0.05 * i, geometry::SE3(geometry::so3_exp({0.1 * i, 0, 0}), {1.0 * i, 2, 3})});
  }
  dataset::Dataset flown(bool with_truth) {
    imaging::Calibration calibration{.camera = imaging::make_pinhole(32, 24, 90.0)};
    calibration.T_cam_imu = geometry::SE3(Eigen::Quaterniond(0.7, 0.1, -0.7, 0.1), {0.1, -0.02, 0.3});
    dataset::DatasetWriter writer(folder_ / "own", calibration, {.replace = true, .png = true});
    for (int i = 0; i < 3; ++i) writer.add_frame(i, truth_.poses[i].time_s, 0.0, imaging::RgbImage(32, 24));
    if (with_truth) writer.set_groundtruth(truth_);
    writer.finish();
    return dataset::read_dataset(folder_ / "own");
  }
  tests::TemporaryFolder folder_;
  geometry::Trajectory truth_;
};

// In whatever layout a flight lies, its lens and true poses are the same.
TEST_F(MapInputsOfAFlight, EveryLayoutGivesCameraAndTrueCameraPoses) {
  const dataset::Dataset own = flown(true);
  for (const std::string layout : {"own", "euroc", "vslamlab"}) {
    if (layout != "own") exports::export_dataset(own, layout, folder_ / layout, false);
    const MapInputs inputs = find_map_inputs(folder_ / "odometry", folder_ / layout);
    const geometry::Trajectory poses = read_true_poses(inputs.truth_trajectory);
    ASSERT_EQ(poses.size(), truth_.size()) << layout;
    for (std::size_t i = 0; i < poses.size(); ++i) {
      EXPECT_EQ(poses.poses[i].time_s, truth_.poses[i].time_s);
      EXPECT_LT((poses.poses[i].T_local_camera.matrix() - truth_.poses[i].T_local_camera.matrix()).norm(), 1e-9);
    }
    EXPECT_NEAR(read_flight_camera(inputs.camera).horizontal_fov_deg(), 90.0, 1e-9) << layout;
    EXPECT_EQ(inputs.dataset, folder_ / layout);
  }
}

TEST_F(MapInputsOfAFlight, ADatasetIsTheTruthOfATrajectoryAlone) {
  const dataset::Dataset own = flown(true);
  geometry::write_tum(folder_ / "estimate.txt", truth_);
  for (const std::string layout : {"own", "euroc"}) {
    if (layout != "own") exports::export_dataset(own, layout, folder_ / layout, false);
    const nlohmann::json metrics = evaluate_trajectories(
        {.estimates = {folder_ / "estimate.txt"}, .truth = folder_ / layout}, folder_ / (layout + ".json"));
    EXPECT_EQ(metrics["trajectory"]["poses"], 3) << layout;
    EXPECT_LT(metrics["trajectory"]["ate_rmse"], 1e-9) << layout;
  }
}

TEST_F(MapInputsOfAFlight, ADatasetWithoutTruthHasNone) {
  exports::export_dataset(flown(false), "vslamlab", folder_ / "out", false);
  EXPECT_TRUE(find_map_inputs(folder_ / "odometry", folder_ / "out").truth_trajectory.empty());
  EXPECT_THAT(refusal_of([&] { read_true_poses(folder_ / "out"); }), HasSubstr("the dataset has no true poses"));
  EXPECT_THAT(refusal_of([&] { find_map_inputs(folder_ / "odometry", folder_ / "none"); }),
              HasSubstr("no such dataset folder"));
}

}  // namespace
}  // namespace tileflight::scoring::map_inputs_test
