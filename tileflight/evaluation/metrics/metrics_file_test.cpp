#include "tileflight/evaluation/metrics/metrics_file.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <random>
#include <set>
#include <string>

#include "tests/refusal.h"
#include "tests/temporary_folder.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/geometry/cloud_files.h"
#include "tileflight/evaluation/metrics/distances.h"
#include "tileflight/evaluation/metrics/evaluate.h"

namespace tileflight::metrics::metrics_file_test {
namespace {

using geometry::PointCloud;
using geometry::Vec3;
using nlohmann::json;

const std::set<std::string> kNotInOlderFiles{"map.percentiles",
                                             "map.cumulative",
                                             "surface.percentiles",
                                             "surface.cumulative",
                                             "surface.normals",
                                             "trajectory.drift",
                                             "trajectory.scale_drift",
                                             "trajectory.ate_median",
                                             "trajectory.ate_std",
                                             "trajectory.ate_min",
                                             "trajectory.alignment",
                                             "trajectory.rpe_frames",
                                             "trajectory.poses_estimated",
                                             "trajectory.poses_true",
                                             "trajectory.time_covered",
                                             "entropy",
                                             "wasserstein",
                                             "error_budget"};

PointCloud scattered(std::size_t n, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> coordinate(0.0, 9.0);
  PointCloud cloud;
  for (std::size_t k = 0; k < n; ++k)
    cloud.positions.push_back({coordinate(random), coordinate(random), coordinate(random)});
  return cloud;
}

geometry::Trajectory walk() {
  geometry::Trajectory trajectory;
  for (int k = 0; k < 60; ++k) {
    trajectory.poses.push_back({0.1 * k, {geometry::so3_exp({0, 0, 0.02 * k}), {0.3 * k, std::sin(0.2 * k), 0.1 * k}}});
  }
  return trajectory;
}

MapEvaluation some_score() {
  geometry::TriangleMesh mesh;
  mesh.vertices = {{0, 0, 4}, {9, 0, 4}, {0, 9, 5}};
  mesh.triangles = {{0, 1, 2}};
  const PointCloud centers = scattered(300, 1), samples = scattered(200, 2);
  const geometry::Trajectory truth = walk();
  geometry::Trajectory estimate = truth;
  for (std::size_t k = 0; k < estimate.size(); k += 2) estimate.poses[k].T_local_camera.translation.z() += 0.05;
  PointCloud map = scattered(500, 3);
  map.positions.push_back(centers.positions[0] + Vec3(0, 0, 1.0));  // at the cut-off, but for another centre
  MapEvaluation score = evaluate(map, {&centers, &samples, &mesh, &samples, &estimate, &truth});
  map.normals.assign(map.size(), Eigen::Vector3f::UnitZ());
  score.metrics.surface->normals = normal_consistency(map, mesh, geometry::TriangleIndex(mesh), 1.0, 0);
  score.metrics.entropy = map_entropy(map);
  score.metrics.wasserstein = voxel_wasserstein(map, samples, {.min_points = 3});
  score.metrics.error_budget =
      error_budget({.floor_rmse_m = score.metrics.map.quantization_floor.rmse, .surface_m = score.errors.surface_m});
  return score;
}

class MetricsFiles : public ::testing::Test {
 protected:
  tests::TemporaryFolder folder_;
  std::filesystem::path file_ = folder_ / "metrics.json";
  MapEvaluation score_ = some_score();

  void write(const json& object) { base::write_file(file_, object.dump()); }
  json written() { return json::parse(base::read_text(file_)); }

  std::string complaint() {
    return tests::refusal_of([&] { read_metrics(file_); });
  }
};

TEST_F(MetricsFiles, RoundTrip) {
  write_metrics(file_, score_.metrics, score_.errors);
  const MetricsFile back = read_metrics(file_);
  EXPECT_EQ(to_json(back.metrics).dump(), to_json(score_.metrics).dump());
  EXPECT_EQ(back.voxel.distances.size(), score_.metrics.map.correspondences);
  EXPECT_EQ(back.voxel.points, score_.metrics.map.points);
  EXPECT_NEAR(compute_statistics(back.voxel.distances).mean, score_.metrics.map.distances.mean, 1e-7);
  ASSERT_TRUE(back.surface);
  EXPECT_NEAR(compute_statistics(back.surface->distances).mean, score_.metrics.surface->distances.mean, 1e-6);
  EXPECT_EQ(back.voxel.positions.size(), back.voxel.distances.size());
}

TEST_F(MetricsFiles, AReceiversPartIsKeptAndItMeasuresNoRotations) {
  score_.metrics.trajectory->receiver = ReceiverError{.horizontal_sigma_m = 1.0,
                                                      .vertical_sigma_m = 2.0,
                                                      .expected_rmse_m = std::sqrt(6.0),
                                                      .beyond_receiver_m = 0.3,
                                                      .normalized_error_squared = 1.1,
                                                      .time_offset_s = 31.3,
                                                      .time_offset_sigma_s = 0.02,
                                                      .lever_arm_m = Vec3(0.5, -1.5, 0.8)};
  write_metrics(file_, score_.metrics, score_.errors);
  const json trajectory = written().at("trajectory");
  EXPECT_TRUE(trajectory.at("rpe").at(0).at("rotation_rmse_deg").is_null());
  EXPECT_TRUE(trajectory.at("drift").at("rotation_deg_per_m").is_null());
  const MetricsFile back = read_metrics(file_);
  EXPECT_EQ(to_json(back.metrics).dump(), to_json(score_.metrics).dump());
  EXPECT_EQ(back.metrics.trajectory->receiver->lever_arm_m, Vec3(0.5, -1.5, 0.8));
}

TEST_F(MetricsFiles, ErrorsLieBesideAsScalars) {
  write_metrics(file_, score_.metrics, score_.errors);
  const PointCloud errors = geometry::read_cloud(folder_ / "errors.ply");
  EXPECT_EQ(errors.size(), score_.errors.aligned_map.size());
  EXPECT_EQ(errors.positions, score_.errors.aligned_map.positions);
  EXPECT_TRUE(errors.scalars.contains("voxel_distance"));
  EXPECT_TRUE(errors.scalars.contains("surface_distance"));
}

TEST_F(MetricsFiles, FloatsStayOnTheirSideOfTheCutOff) {
  PointErrors errors;
  const double above = std::nextafter(1.0, 2.0);
  errors.aligned_map.positions = {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}};
  errors.voxel_m = {1.0, above, 0.25};
  Metrics metrics;
  metrics.map = score_map(errors.voxel_m, {}, {});
  ASSERT_EQ(metrics.map.correspondences, 2u);
  write_metrics(file_, metrics, errors);
  EXPECT_EQ(read_metrics(file_).voxel.distances.size(), 2u);
}

TEST_F(MetricsFiles, WithoutSurfaceAndTrajectoryTheyAreNull) {
  score_.metrics.surface.reset();
  score_.metrics.trajectory.reset();
  score_.errors.surface_m.clear();
  write_metrics(file_, score_.metrics, score_.errors);
  EXPECT_TRUE(written().at("surface").is_null());
  EXPECT_TRUE(written().at("trajectory").is_null());
  const MetricsFile back = read_metrics(file_);
  EXPECT_FALSE(back.metrics.surface);
  EXPECT_FALSE(back.metrics.trajectory);
  EXPECT_FALSE(back.surface);
}

TEST_F(MetricsFiles, KeysOfTheContract) {
  write_metrics(file_, score_.metrics, score_.errors);
  const json m = written();
  for (const char* key : {"/map/points",
                          "/map/correspondences",
                          "/map/mean",
                          "/map/std",
                          "/map/median",
                          "/map/rmse",
                          "/map/percentiles/25",
                          "/map/percentiles/99",
                          "/map/histogram/edges",
                          "/map/histogram/counts",
                          "/map/cutoff",
                          "/map/truth",
                          "/map/quantization_floor/mean",
                          "/map/quantization_floor/std",
                          "/map/share_kept",
                          "/surface/mean",
                          "/surface/std",
                          "/surface/median",
                          "/surface/rmse",
                          "/surface/percentiles/50",
                          "/surface/accuracy/0.1",
                          "/surface/accuracy/1",
                          "/surface/completeness/0.5",
                          "/surface/f_score/0.2",
                          "/trajectory/ate_rmse",
                          "/trajectory/ate_mean",
                          "/trajectory/ate_max",
                          "/trajectory/rpe/0/translation_rmse_m",
                          "/trajectory/path_length",
                          "/trajectory/scale"}) {
    EXPECT_TRUE(m.contains(json::json_pointer(key))) << key;
  }
  EXPECT_EQ(m.at("map").at("truth"), "voxel-centres");
}

TEST_F(MetricsFiles, EveryMissingKeyIsNamed) {
  write_metrics(file_, score_.metrics, score_.errors);
  const json whole = written();
  for (const char* section : {"map", "surface", "trajectory"}) {
    ASSERT_FALSE(whole.at(section).empty()) << section;
    for (const auto& item : whole.at(section).items()) {
      if (kNotInOlderFiles.contains(std::string(section) + "." + item.key())) continue;
      json without = whole;
      without.at(section).erase(item.key());
      write(without);
      EXPECT_NE(complaint().find("'" + std::string(section) + "." + item.key() + "' is missing"), std::string::npos)
          << complaint();
    }
    json without = whole;
    without.erase(section);
    write(without);
    EXPECT_NE(complaint().find("'" + std::string(section) + "' is missing"), std::string::npos) << complaint();
  }
}

TEST_F(MetricsFiles, OlderFilesAreRead) {
  write_metrics(file_, score_.metrics, score_.errors);
  json older = written();
  for (const std::string& key : kNotInOlderFiles) {
    const auto dot = key.find('.');
    json& holder = dot == std::string::npos ? older : older.at(key.substr(0, dot));
    ASSERT_EQ(holder.erase(key.substr(dot == std::string::npos ? 0 : dot + 1)), 1u) << key;
  }
  write(older);
  const MetricsFile back = read_metrics(file_);
  EXPECT_TRUE(back.metrics.map.percentiles.empty());
  EXPECT_TRUE(back.metrics.surface->percentiles.empty());
  EXPECT_EQ(back.metrics.map.distances.mean, score_.metrics.map.distances.mean);
}

TEST_F(MetricsFiles, UnknownAndWrongKeysAreNamed) {
  write_metrics(file_, score_.metrics, score_.errors);
  const json whole = written();
  json changed = whole;
  changed["map"]["meen"] = 1;
  write(changed);
  EXPECT_NE(complaint().find("'map.meen' is not a key here; did you mean 'mean'"), std::string::npos) << complaint();
  const std::pair<const char*, json> wrong[] = {{"/map/points", -3},
                                                {"/map/points", "many"},
                                                {"/map/mean", "small"},
                                                {"/map/histogram", 5},
                                                {"/map/histogram/counts", {1}},
                                                {"/map/truth", "surface"},
                                                {"/map/percentiles", 3},
                                                {"/map/percentiles", {{"half", 0.1}}},
                                                {"/surface/percentiles", {{"101", 0.1}}},
                                                {"/surface/accuracy", {{"wide", 1}}},
                                                {"/trajectory/rpe", 3},
                                                {"/trajectory/rpe/0", 3},
                                                {"/map", json::array()},
                                                {"/map/correspondences", 10000000}};
  for (const auto& [place, value] : wrong) {
    changed = whole;
    changed[json::json_pointer(place)] = value;
    write(changed);
    EXPECT_NE(complaint().find("metrics.json"), std::string::npos) << place;
  }
}

TEST_F(MetricsFiles, BrokenJsonAndMissingFilesAreClear) {
  write_metrics(file_, score_.metrics, score_.errors);
  const std::string whole = base::read_text(file_);
  base::write_file(file_, whole.substr(0, whole.size() / 2));
  EXPECT_NE(complaint().find("not valid JSON"), std::string::npos);
  base::write_file(file_, "[]");
  EXPECT_NE(complaint().find("must be a map of keys"), std::string::npos);
  base::write_file(file_, whole);
  std::filesystem::remove(folder_ / "errors.ply");
  EXPECT_NE(complaint().find("errors.ply"), std::string::npos);
  geometry::write_cloud(folder_ / "errors.ply", scattered(10, 4));
  EXPECT_NE(complaint().find("voxel_distance"), std::string::npos);
  std::filesystem::remove(file_);
  EXPECT_NE(complaint().find("metrics.json"), std::string::npos);
}

TEST_F(MetricsFiles, ErrorsOfAnotherRunAreRefused) {
  write_metrics(file_, score_.metrics, score_.errors);
  json changed = written();
  changed["map"]["correspondences"] = score_.metrics.map.correspondences - 1;
  write(changed);
  EXPECT_NE(complaint().find("belongs to a different run"), std::string::npos) << complaint();
}

}  // namespace
}  // namespace tileflight::metrics::metrics_file_test
