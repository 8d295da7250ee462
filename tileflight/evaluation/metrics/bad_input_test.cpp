// Unusable maps, surfaces and trajectories give an error of one line or a defined value.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "tests/refusal.h"
#include "tileflight/evaluation/metrics/evaluate.h"
#include "tileflight/evaluation/metrics/map_entropy.h"
#include "tileflight/evaluation/metrics/test_scores.h"

namespace tileflight::metrics::bad_input_test {
namespace {

using geometry::PointCloud;
using geometry::TriangleMesh;
using geometry::Vec3;
using ::testing::HasSubstr;

const double kNaN = std::numeric_limits<double>::quiet_NaN();

PointCloud cloud_of(std::vector<Vec3> positions) {
  PointCloud cloud;
  cloud.positions = std::move(positions);
  return cloud;
}

TriangleMesh triangle() {
  TriangleMesh mesh;
  mesh.vertices = {{0, 0, 0}, {10, 0, 0}, {0, 10, 0}};
  mesh.triangles = {{0, 1, 2}};
  return mesh;
}

MapEvaluation score_of(const PointCloud& map, const TriangleMesh& mesh) {
  const PointCloud centers = cloud_of({{0.5, 0.5, 0.5}, {1.5, 0.5, 0.5}}), samples = cloud_of({{1, 1, 0}, {2, 2, 0}});
  return evaluate(map, {&centers, &samples, &mesh, &samples, nullptr, nullptr});
}

geometry::Trajectory line(double from_s, double yaw_rad = 0.0) {
  geometry::Trajectory trajectory;
  for (int k = 0; k < 30; ++k)
    trajectory.poses.push_back({from_s + 0.1 * k, {geometry::so3_exp({0, 0, yaw_rad}), {0.5 * k, std::sin(k), 0}}});
  return trajectory;
}

TEST(BadInput, EmptyMapAndNaNAreOneLine) {
  EXPECT_EQ(tests::refusal_of([] { score_of({}, triangle()); }), "map: has no points; there is nothing to score");
  EXPECT_EQ(tests::refusal_of([] {
              score_of(cloud_of({{0, 0, 0}, {kNaN, 0, 0}}), triangle());
            }),
            "map: point 1 is not finite");
}

TEST(BadInput, OnePointHasADistanceAndNoSpread) {
  const MapEvaluation score = score_of(cloud_of({{1, 1, 0.25}}), triangle());
  EXPECT_EQ(score.metrics.map.correspondences, 1u);
  EXPECT_TRUE(std::isnan(score.metrics.map.distances.std));
  EXPECT_DOUBLE_EQ(score.metrics.surface->distances.median, 0.25);
  EXPECT_EQ(metrics_from_json(nlohmann::json::parse(to_json(score.metrics).dump()), "m").map.points, 1u)
      << "what is not a number is null, and is read again";
}

TEST(BadInput, OnlyOutliersAreAScoreOfNothing) {
  const MapEvaluation score = score_of(cloud_of({{500, 0, 0}, {0, 800, 0}, {0, 0, -1e7}}), triangle());
  EXPECT_EQ(score.metrics.map.correspondences, 0u);
  EXPECT_TRUE(std::isnan(score.metrics.map.distances.mean));
  EXPECT_EQ(score.metrics.surface->accuracy.at(1.0), 0.0);
  EXPECT_EQ(score.metrics.surface->completeness.at(1.0), 0.0);
  EXPECT_EQ(score.metrics.surface->f_score.at(1.0), 0.0) << "not 0/0";
  EXPECT_NEAR(score.metrics.surface->percentiles.at(50), 790.0, 1e-9);
}

TEST(BadInput, TrianglesWithoutAreaAreSegmentsAndPoints) {
  TriangleMesh flat = triangle();
  flat.triangles = {{0, 0, 0}, {1, 1, 0}};
  const MapEvaluation score = score_of(cloud_of({{4, 3, 0}, {12, 0, 0}}), flat);
  EXPECT_DOUBLE_EQ(score.errors.surface_m[0], 3.0);
  EXPECT_DOUBLE_EQ(score.errors.surface_m[1], 2.0);
}

TEST(BadInput, TrajectoriesWithoutCommonTimesOrMotionAreOneLine) {
  const auto refusal = [](const geometry::Trajectory& estimate, const geometry::Trajectory& truth) {
    return tests::refusal_of([&] { evaluate_trajectory(estimate, truth, {.alignment = TrajectoryAlignment::kSim3}); });
  };
  EXPECT_THAT(refusal(line(0), line(1000)), HasSubstr("only 0 of its poses share a time with the truth"));
  EXPECT_THAT(refusal({}, line(0)), HasSubstr("share a time"));
  geometry::Trajectory still = line(0);
  for (auto& pose : still.poses) pose.T_local_camera.translation = {1, 2, 3};
  EXPECT_THAT(refusal(still, line(0)), HasSubstr("does not move"));
}

TEST(BadInput, AnotherFrameIsAlignedAwayOrAnError) {
  const geometry::Sim3 elsewhere(0.1, geometry::so3_exp({0, 0, std::numbers::pi}), {1e6, -2e5, 300});
  const geometry::Trajectory truth = line(0), moved = geometry::transformed(elsewhere, truth);
  EXPECT_LT(evaluate_trajectory(moved, truth, {.alignment = TrajectoryAlignment::kSim3}).ate_rmse_m, 1e-6);
  EXPECT_GT(evaluate_trajectory(moved, truth, {.alignment = TrajectoryAlignment::kNone}).ate_rmse_m, 1e5);
}

TEST(BadInput, NoOverlapIsAComparisonThatDecidesNothing) {
  const auto run_at = [](double x) {
    KeptDistances kept;
    for (int k = 0; k < 50; ++k) {
      kept.positions.push_back({x, 10.0 * k, 0});
      kept.distances.push_back(0.3 + 0.01 * (k % 7));
    }
    kept.points = 60;
    return kept;
  };
  const DistanceComparison c = compare_distances(run_at(0), run_at(1e5));
  EXPECT_EQ(c.mean_difference_m, 0.0);
  EXPECT_TRUE(std::isfinite(c.mean_difference_ci95[0])) << "two places are two samples";
  EXPECT_THAT(tests::refusal_of([&] { compare_distances({}, run_at(0)); }),
              HasSubstr("no map point lies within the cut-off"));
}

TEST(BadInput, TenMillionPointsAreScored) {
  PointCloud map;
  map.positions.reserve(10'000'000);
  for (int k = 0; k < 10'000'000; ++k) map.positions.push_back({1e-6 * k, 0.5, 0.5});
  const MapMetrics m = evaluate_map(map, cloud_of({{0.5, 0.5, 0.5}}), {});
  EXPECT_EQ(m.points, 10'000'000u);
  EXPECT_NEAR(static_cast<double>(m.correspondences), 1.5e6, 2.0) << "x from 0 to 1.5";
}

}  // namespace
}  // namespace tileflight::metrics::bad_input_test
