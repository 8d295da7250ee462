#include "tileflight/slam/mapping/map.h"

#include <gtest/gtest.h>

#include "tileflight/slam/odometry/debug_image.h"
#include "tileflight/slam/odometry/synthetic_flight.h"

namespace tileflight::odometry::map_test {
namespace {

const test_support::Sequence& flight() {
  static const test_support::Sequence kFlight =
      test_support::render_hill_flight(imaging::make_fisheye(320, 200, 130.0), 40);
  return kFlight;
}

OdometryResult run(bool dense, const KeyframeObserver& observer = {}) {
  keyframes::OdometryOptions options = test_support::small_options();
  options.map.dense = dense;
  options.window.min_keyframes = 3;  // so that keyframes leave within this short flight
  options.window.max_keyframes = 4;
  OdometryInput input = flight().calibration;
  input.keyframe_observer = observer;
  return run_odometry(input, flight().source(), options);
}

TEST(Map, FurtherPointsAreAsTrueAsTheOptimisedOnesAndChangeNothingElse) {
  const OdometryResult sparse = run(false), dense = run(true);
  ASSERT_EQ(sparse.trajectory.size(), dense.trajectory.size());
  for (std::size_t i = 0; i < sparse.trajectory.size(); ++i) {
    EXPECT_TRUE(sparse.trajectory.poses[i].T_local_camera.matrix() ==
                dense.trajectory.poses[i].T_local_camera.matrix());
  }
  EXPECT_GT(dense.map.size(), 1.15 * static_cast<double>(sparse.map.size()));
  const double of_sparse =
      base::upper_median(test_support::height_errors_m(test_support::hilly_ground(), sparse, flight().truth));
  const double of_dense =
      base::upper_median(test_support::height_errors_m(test_support::hilly_ground(), dense, flight().truth));
  EXPECT_LT(of_sparse, 0.08);
  EXPECT_LT(of_dense, 1.5 * of_sparse);
}

TEST(Map, TracksNameKeyframesThatSeeThePoint) {
  const OdometryResult result = run(true);
  ASSERT_EQ(result.keyframe_frame_indices.size(), result.keyframes.size());
  ASSERT_EQ(result.map_point_keyframes.size(), result.map.size());
  std::size_t seen_elsewhere = 0;
  for (std::size_t i = 0; i < result.map.size(); ++i) {
    seen_elsewhere += result.map_point_keyframes[i].size() - 1;
    for (const int k : result.map_point_keyframes[i]) {
      const geometry::Vec3 X = result.keyframes.poses.at(k).T_local_camera.inverse() * result.map.positions[i];
      const auto pixel = flight().calibration.camera.project(X);
      ASSERT_TRUE(pixel);
      EXPECT_GT(pixel->minCoeff(), -1.0);
      EXPECT_LT(pixel->x(), 320.0);
      EXPECT_LT(pixel->y(), 200.0);
    }
  }
  EXPECT_GT(seen_elsewhere, result.map.size());
}

TEST(Map, FiltersKeepWhatTheySay) {
  mapping::MapPoint good;
  good.ray = Eigen::Vector3f::UnitZ();
  good.rho = 0.1F;
  good.rho_variance = 1e-8F;
  good.parallax_rad = 0.1F;
  good.observations = 5;
  const keyframes::MapOptions options;
  EXPECT_TRUE(mapping::passes_filters(good, options));
  const auto spoiled = [&](auto&& spoil) {
    mapping::MapPoint point = good;
    spoil(point);
    return mapping::passes_filters(point, options);
  };
  EXPECT_FALSE(spoiled([](mapping::MapPoint& p) { p.rho = -0.1F; }));
  EXPECT_FALSE(spoiled([&](mapping::MapPoint& p) { p.observations = options.min_observations - 1; }));
  EXPECT_FALSE(
      spoiled([&](mapping::MapPoint& p) { p.parallax_rad = 0.9F * static_cast<float>(options.min_parallax_rad); }));
  EXPECT_FALSE(spoiled([&](mapping::MapPoint& p) {
    const double deviation = 1.1 * options.max_relative_sigma * p.rho;
    p.rho_variance = static_cast<float>(deviation * deviation);
  }));
}

TEST(DebugPicture, ShowsThePointsOfEachKeyframeNearRedFarBlue) {
  std::vector<std::int64_t> indices;
  const OdometryResult result = run(false, [&](const KeyframeView& view) {
    indices.push_back(view.index);
    ASSERT_GT(view.points.size(), 50U);
    const imaging::RgbImage picture = draw_debug_image(view);
    ASSERT_EQ(picture.width, 320);
    double near_red = 0, far_red = 0, nearest = 0, farthest = 1e9;
    for (const KeyframeView::Point& point : view.points) {
      const auto color = picture(static_cast<int>(std::lround(point.x)), static_cast<int>(std::lround(point.y)));
      const double red = color[0] - color[2];
      if (point.inverse_distance > nearest) nearest = point.inverse_distance, near_red = red;
      if (point.inverse_distance < farthest) farthest = point.inverse_distance, far_red = red;
    }
    EXPECT_GT(near_red, 200);
    EXPECT_LT(far_red, 200);
  });
  EXPECT_EQ(indices, result.keyframe_frame_indices);
  EXPECT_EQ(depth_color(0.0), (imaging::Rgb8{0, 0, 255}));
  EXPECT_EQ(depth_color(0.5), (imaging::Rgb8{0, 255, 0}));
  EXPECT_EQ(depth_color(1.0), (imaging::Rgb8{255, 0, 0}));
}

}  // namespace
}  // namespace tileflight::odometry::map_test
