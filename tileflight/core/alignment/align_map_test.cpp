#include "tileflight/core/alignment/align_map.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <random>

#include "tests/height_field.h"
#include "tileflight/core/alignment/transform_file.h"
#include "tileflight/core/base/input_error.h"

namespace tileflight::alignment::align_map_test {
namespace {

using geometry::PointCloud;
using geometry::Sim3;
using geometry::Trajectory;
using geometry::TriangleIndex;
using geometry::TriangleMesh;
using geometry::Vec3;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

constexpr double kHalf_m = 60.0;

/// Hills with a few block-shaped buildings.
double height_m(double x, double y) {
  double z = 4.0 * std::sin(0.06 * x) + 3.0 * std::cos(0.09 * y + 0.02 * x);
  for (const Vec3& b : {Vec3(20, 10, 9), Vec3(-30, 25, 6), Vec3(5, -35, 12), Vec3(-20, -20, 5)}) {
    if (std::abs(x - b.x()) < 8.0 && std::abs(y - b.y()) < 6.0) z += b.z();
  }
  return z;
}

TriangleMesh place() {
  TriangleMesh mesh;
  const int cells = static_cast<int>(2.0 * kHalf_m);
  for (int i = 0; i <= cells; ++i) {
    for (int j = 0; j <= cells; ++j)
      mesh.vertices.push_back({i - kHalf_m, j - kHalf_m, height_m(i - kHalf_m, j - kHalf_m)});
  }
  const auto at = [&](int i, int j) { return static_cast<std::uint32_t>(i * (cells + 1) + j); };
  for (int i = 0; i < cells; ++i) {
    for (int j = 0; j < cells; ++j) {
      mesh.triangles.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
      mesh.triangles.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
    }
  }
  return mesh;
}

/// As from odometry, in the local frame: points on the surface with noise of 0.2 m, a tenth of them outliers.
PointCloud surface_points(const TriangleMesh& mesh, std::size_t n) {
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  std::normal_distribution<double> noise(0.0, 0.2);
  PointCloud cloud;
  for (std::size_t k = 0; k < n; ++k) {
    const auto& [a, b, c] = mesh.triangles[random() % mesh.triangles.size()];
    const double u = unit(random), v = unit(random) * (1.0 - u);
    Vec3 p = (1.0 - u - v) * mesh.vertices[a] + u * mesh.vertices[b] + v * mesh.vertices[c];
    p += Vec3(noise(random), noise(random), noise(random));
    if (k % 10 == 0) p.z() += 15.0 * (unit(random) - 0.3);
    cloud.positions.push_back(p);
  }
  return cloud;
}

/// Cell centres at 1 m of the cells that sampled points of the surface fall into.
PointCloud voxel_centers(const TriangleMesh& mesh) {
  PointCloud centers;
  for (const Vec3& p : surface_points(mesh, 60000).positions) {
    centers.positions.push_back(p.array().floor() + 0.5);
  }
  return centers;
}

Vec3 path(double t) { return {40.0 * std::sin(0.15 * t), 30.0 * std::cos(0.21 * t), 45.0 + 3.0 * std::sin(0.3 * t)}; }

Sim3 T_local_map() { return {8.0, geometry::so3_exp({2.0, 0.3, -0.5}), {10.0, -5.0, 40.0}}; }

Trajectory map_trajectory() {
  Trajectory trajectory;
  for (int k = 0; k <= 400; ++k) {
    trajectory.poses.push_back({0.1 * k, {Eigen::Quaterniond::Identity(), T_local_map().inverse() * path(0.1 * k)}});
  }
  return trajectory;
}

/// Positions with a rotating bias of 2.5 m, noise and a lag.
std::vector<PositionFix> fixes() {
  std::mt19937_64 random(4);
  std::normal_distribution<double> noise(0.0, 0.3);
  std::vector<PositionFix> result;
  for (int k = 0; k < 400; ++k) {
    const double t = 0.1 * k;
    const Vec3 bias(1.5 + 0.5 * std::sin(0.1 * t), -1.0 + 0.5 * std::cos(0.08 * t), 1.8 - 0.02 * t);
    result.push_back({t, path(t - 0.3) + bias + Vec3(noise(random), noise(random), noise(random)), 0.3, 0.3});
  }
  return result;
}

class AlignMap : public ::testing::Test {
 protected:
  TriangleMesh mesh_ = place();
  TriangleIndex index_{mesh_};
  PointCloud centers_ = voxel_centers(mesh_);
  PointCloud local_ = surface_points(mesh_, 3000);
  PointCloud map_ = transformed(T_local_map().inverse(), local_);
  AlignmentTarget target_{&centers_, &index_, &mesh_};

  double error_m(const Sim3& T) const {
    double sum = 0.0;
    for (std::size_t i = 0; i < map_.size(); ++i) sum += (T * map_.positions[i] - local_.positions[i]).squaredNorm();
    return std::sqrt(sum / static_cast<double>(map_.size()));
  }
};

TEST_F(AlignMap, FromTelemetryToTheSurface) {
  AlignMapOptions options;
  options.icp.method = IcpMethod::kPointToMesh;
  const MapAlignment alignment = align_map(map_, map_trajectory(), fixes(), target_, options);
  ASSERT_TRUE(alignment.trajectory);
  EXPECT_NEAR(alignment.trajectory->time_offset_s, -0.3, 0.1);
  EXPECT_GT(error_m(alignment.trajectory->T_local_map), 1.5) << "telemetry alone is metres off";
  EXPECT_LT(error_m(alignment.result.T_target_source), 0.12) << alignment.result.note;
  EXPECT_NEAR(alignment.result.T_target_source.scale, 8.0, 0.02);
  EXPECT_TRUE(alignment.result.converged) << alignment.result.note;
  EXPECT_EQ(alignment.steps.size(), 4u);
}

TEST_F(AlignMap, PaperSettingsToVoxelCentres) {
  const MapAlignment alignment = align_map(map_, map_trajectory(), fixes(), target_);
  EXPECT_EQ(alignment.result.method, "icp-point-to-point");
  EXPECT_LT(error_m(alignment.result.T_target_source), 0.3) << alignment.result.note;
}

TEST_F(AlignMap, WithoutAMeshTheCloudServes) {
  const AlignmentTarget cloud_only{&centers_, nullptr, nullptr};
  const MapAlignment alignment = align_map(map_, map_trajectory(), fixes(), cloud_only);
  EXPECT_EQ(alignment.steps.front().method, "icp-point-to-point");
  EXPECT_LT(error_m(alignment.result.T_target_source), 0.4) << alignment.result.note;

  AlignMapOptions options;
  options.icp.method = IcpMethod::kPointToMesh;
  EXPECT_THAT([&] { align_map(map_, T_local_map(), cloud_only, options); },
              ThrowsMessage<InputError>(HasSubstr("point-to-mesh needs a ground truth with a mesh")));
  EXPECT_THAT(
      [&] {
        align_map(map_, T_local_map(), {nullptr, &index_, &mesh_});
      },
      ThrowsMessage<InputError>(HasSubstr("need a ground truth cloud")));
}

TEST_F(AlignMap, PullsInTiltedAndShiftedStarts) {
  AlignMapOptions options;
  options.icp.method = IcpMethod::kPointToMesh;
  std::mt19937_64 random(9);
  std::uniform_real_distribution<double> sign(-1.0, 1.0);
  const auto direction = [&] { return Vec3(sign(random), sign(random), sign(random)).normalized(); };
  for (int k = 0; k < 5; ++k) {
    const Sim3 off(1.0 + 0.02 * sign(random), geometry::so3_exp(0.06 * direction()), 3.0 * direction());
    const MapAlignment alignment = align_map(map_, off * T_local_map(), target_, options);
    EXPECT_LT(error_m(alignment.result.T_target_source), 0.12) << "start " << k << ": " << alignment.result.note;
    EXPECT_GT(alignment.moved_from_start_m, 1.0);
  }
}

TEST_F(AlignMap, PullsInStartsTenMetresFifteenDegreesAndAFifthOfTheScaleOff) {
  AlignMapOptions options;
  options.icp.method = IcpMethod::kPointToMesh;
  const Vec3 shift = 10.0 * Vec3(0.6, -0.64, 0.48), turn_rad = 0.2618 * Vec3(0.48, 0.6, -0.64);
  for (const auto& [scale, sign] : {std::pair{0.8, 1.0}, {1.2, -1.0}}) {
    const Sim3 off(scale, geometry::so3_exp(sign * turn_rad), sign * shift);
    const IcpResult result = align_map(map_, off * T_local_map(), target_, options).result;
    EXPECT_LT(error_m(result.T_target_source), 0.12) << "scale " << scale << ": " << result.note;
    EXPECT_TRUE(result.converged) << result.note;
  }
}

TEST_F(AlignMap, OfTheScaleSeedsTheBestIsGoneOnWith) {
  // The true scale is 2.1 times the start's: out of reach from the start itself, but not from a seed at twice its
  // scale.
  AlignMapOptions options;
  options.icp.method = IcpMethod::kPointToMesh;
  options.icp.max_scale_change = 2.2;
  const Sim3 start(8.0 / 2.1, T_local_map().rotation, T_local_map().translation);
  options.scale_seeds = {1.0};
  EXPECT_GT(error_m(align_map(map_, start, target_, options).result.T_target_source), 1.0);
  options.scale_seeds = {1.0, 2.0};
  const MapAlignment found = align_map(map_, start, target_, options);
  EXPECT_LT(error_m(found.result.T_target_source), 0.12) << found.result.note;
  EXPECT_DOUBLE_EQ(found.scale_seed, 2.0);
  EXPECT_EQ(found.steps.size(), 4u) << "those of the seed that won";
}

TEST(Thinned, LeavesEveryKth) {
  PointCloud cloud;
  for (int k = 0; k < 1001; ++k) cloud.positions.emplace_back(k, 0, 0);
  EXPECT_EQ(subsample(cloud, 2000).size(), 1001u);
  EXPECT_EQ(subsample(cloud, 1001).size(), 1001u);
  const PointCloud half = subsample(cloud, 1000);
  EXPECT_EQ(half.size(), 501u);
  EXPECT_EQ(half.positions[2].x(), 4.0);
  EXPECT_TRUE(subsample({}, 10).empty());
}

TEST_F(AlignMap, TrianglesWithoutAreaAndWildPointsDoNotCount) {
  TriangleMesh degenerate = mesh_;
  degenerate.triangles.push_back({5, 5, 5});
  degenerate.triangles.push_back({1, 1, 2});
  const TriangleIndex index(degenerate);
  AlignMapOptions options;
  options.icp.method = IcpMethod::kPointToMesh;
  const IcpResult result = align_map(map_, T_local_map(), {&centers_, &index, &degenerate}, options).result;
  EXPECT_LT(error_m(result.T_target_source), 0.12) << result.note;

  PointCloud elsewhere;
  for (int k = 0; k < 500; ++k) elsewhere.positions.emplace_back(1e4 + k, 1e5, 1e3);
  const IcpResult nothing = align_map(elsewhere, Sim3(), target_, options).result;
  EXPECT_FALSE(nothing.converged);
  EXPECT_NE(nothing.note.find("no correspondence"), std::string::npos) << nothing.note;
}

TEST(AlignMapToAPlane, SaysThatAnotherScaleFitsAsWell) {
  const TriangleMesh plane = tests::height_field(60, -60.0, 120.0, [](double, double) { return 0.0; });
  const TriangleIndex index(plane);
  PointCloud map;
  for (double x = -40.0; x <= 40.0; x += 2.0) {
    for (double y = -30.0; y <= 30.0; y += 2.0) map.positions.emplace_back(x, y, 0.0);
  }
  AlignMapOptions options;
  options.icp.method = IcpMethod::kPointToMesh;
  const IcpResult result = align_map(map, Sim3(), {nullptr, &index, &plane}, options).result;
  EXPECT_NE(result.note.find("fits as well"), std::string::npos) << result.note;
}

TEST(AlignMapToARoundPlace, SaysWhichTurnIsOpen) {
  // A level floor, and from 25 m on a slope all around: any rotation about the vertical fits equally well.
  const TriangleMesh bowl = tests::height_field(
      100, -50.0, 100.0, [](double x, double y) { return 0.8 * std::max(0.0, std::hypot(x, y) - 25.0); });
  const TriangleIndex index(bowl);
  PointCloud map;
  for (const Vec3& p : surface_points(bowl, 3000).positions) {
    if (std::hypot(p.x(), p.y()) < 48.0) map.positions.push_back(p);
  }
  AlignMapOptions options;
  options.icp.method = IcpMethod::kPointToMesh;
  const Sim3 start(1.03, geometry::so3_exp({0.02, -0.01, 0.2}), {1.0, -1.0, 0.5});
  const IcpResult result = align_map(map, start, {nullptr, &index, &bowl}, options).result;
  EXPECT_FALSE(result.constraint.well_constrained);
  EXPECT_EQ(result.constraint.weakest_motion, "rotation about z");
  EXPECT_NE(result.note.find("ambiguous"), std::string::npos) << result.note;
  EXPECT_NEAR(result.T_target_source.scale, 1.0, 0.005) << "the rest is found";
}

TEST_F(AlignMap, ScaleBoundIsAboutTheFirstStart) {
  AlignMapOptions options;
  options.icp.method = IcpMethod::kPointToMesh;
  options.icp.max_scale_change = 1.01;
  const Sim3 start(8.0 * 1.04, T_local_map().rotation, T_local_map().translation);
  const MapAlignment alignment = align_map(map_, start, target_, options);
  EXPECT_GE(alignment.result.T_target_source.scale, 8.0 * 1.04 / 1.01 - 1e-9) << "steps must not add up";
}

TEST_F(AlignMap, JsonTellsEveryStep) {
  const MapAlignment alignment = align_map(map_, map_trajectory(), fixes(), target_);
  const auto json = to_json(alignment);
  const IcpResult back = alignment_from_json(json, "transform.json");
  EXPECT_LT((back.T_target_source.matrix() - alignment.result.T_target_source.matrix()).norm(), 1e-9);
  EXPECT_EQ(json.at("steps").size(), 4u);
  EXPECT_TRUE(json.at("telemetry").at("time_offset").is_number());
}

}  // namespace
}  // namespace tileflight::alignment::align_map_test
