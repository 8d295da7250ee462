#include "tileflight/evaluation/scoring/evaluate.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <random>

#include "tests/temporary_folder.h"
#include "tests/test_data.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/geometry/cloud_files.h"
#include "tileflight/evaluation/scoring/align_stage.h"
#include "tileflight/world/ground_truth/ground_truth.h"
#include "tileflight/world/place/extract.h"

namespace tileflight::scoring::evaluate_test {
namespace {

namespace fs = std::filesystem;
using geometry::PointCloud;
using geometry::Vec3;
using nlohmann::json;

constexpr const char* kCamera = R"(cam0:
  camera_model: pinhole
  intrinsics: [152.0, 152.0, 159.5, 119.5]
  distortion_model: equidistant
  distortion_coeffs: [0.0, 0.0, 0.0, 0.0]
  resolution: [320, 240]
)";

/// A valley of 1100 m by 28 m, longer than a camera sees, with steep hills that hide what is behind them.
double height_m(double x, double y) { return 6.0 * std::sin(x / 9.0) * std::cos(y / 7.0) + 0.01 * std::abs(y) * y; }

imaging::TexturedMesh strip(double from_x, double to_x) {
  imaging::TexturedMesh m;
  constexpr double kStep_m = 4.0;
  const auto columns = static_cast<std::uint32_t>((to_x - from_x) / kStep_m);
  constexpr std::uint32_t kRows = 7;
  for (std::uint32_t i = 0; i <= columns; ++i) {
    for (std::uint32_t j = 0; j <= kRows; ++j) {
      const double x = from_x + kStep_m * i, y = -14.0 + kStep_m * j;
      m.mesh.vertices.emplace_back(x, y, height_m(x, y));
    }
  }
  for (std::uint32_t i = 0; i < columns; ++i) {
    for (std::uint32_t j = 0; j < kRows; ++j) {
      const std::uint32_t a = i * (kRows + 1) + j, b = a + kRows + 1;
      m.mesh.triangles.push_back({a, b, b + 1});
      m.mesh.triangles.push_back({a, b + 1, a + 1});
    }
  }
  return m;
}

/// The valley as a tileset of two contents, and a flight over its first half with its map.
class Valley {
 public:
  Valley() {
    ground_truth::write_mesh_glb(folder_ / "near.glb", {strip(0, 640), strip(100, 140)}, false);
    ground_truth::write_mesh_glb(folder_ / "far.glb", {strip(640, 1100)}, false);
    const auto tile = [](double middle_x, double half_x, const char* uri) {
      return json{{"boundingVolume", {{"box", {middle_x, 0, 0, half_x, 0, 0, 0, 20, 0, 0, 0, 30}}}},
                  {"geometricError", 0},
                  {"content", {{"uri", uri}}}};
    };
    json root = tile(550, 550, "");
    root.erase("content");
    root["refine"] = "ADD";
    root["geometricError"] = 1;
    root["children"] = {tile(320, 320, "near.glb"), tile(870, 230, "far.glb")};
    base::write_file(folder_ / "tileset.json",
                     json{{"asset", {{"version", "1.1"}}}, {"geometricError", 10}, {"root", root}}.dump());
    base::write_file(folder_ / "camera.yaml", kCamera);
    write_flight();
  }

  fs::path extract(const std::string& name, std::optional<double> block_m) const {
    place::extract({.source = (folder_ / "tileset.json").string(),
                    .load = {.center_local = Vec3(550, 0, 0), .size = Vec3(1090, 26, 60)},
                    .samples_per_m2 = 1.0,
                    .block_m = block_m},
                   folder_ / name, false);
    return folder_ / name;
  }

  MapInputs map() const {
    return {.map = folder_ / "map.ply",
            .trajectory = folder_ / "path.txt",
            .truth_trajectory = folder_ / "path.txt",
            .camera = folder_ / "camera.yaml"};
  }

  fs::path transform() const { return folder_ / "transform.json"; }
  fs::path operator/(const std::string& name) const { return folder_ / name; }

 private:
  /// Looks ahead and down; the map is what lies below, with noise, and some points that are far from everything.
  void write_flight() const {
    geometry::Trajectory path;
    geometry::Mat3 looking;
    looking.col(0) = Vec3(0, -1, 0);
    looking.col(1) = Vec3(-0.6, 0, -0.8);
    looking.col(2) = Vec3(0.8, 0, -0.6);
    for (int i = 0; i < 24; ++i) {
      const double x = 10.0 + 14.0 * i;
      path.poses.push_back({0.5 * i, geometry::SE3(Eigen::Quaterniond(looking), Vec3(x, 3.0 * std::sin(x), 30.0))});
    }
    geometry::write_tum(folder_ / "path.txt", path);
    std::mt19937 random(3);
    std::uniform_real_distribution<double> east(-20.0, 420.0), north(-15.0, 15.0), far(-4000.0, 4000.0);
    std::normal_distribution<double> noise(0.0, 0.15);
    PointCloud map;
    for (int i = 0; i < 6000; ++i) {
      const double x = east(random), y = north(random);
      map.positions.emplace_back(x, y, height_m(x, y) + noise(random));
    }
    for (int i = 0; i < 20; ++i) map.positions.emplace_back(far(random), far(random), far(random));
    // Exactly above vertices, to which several triangles are equally near.
    for (int i = 0; i < 100; ++i) map.positions.emplace_back(4.0 * i, 2.0, height_m(4.0 * i, 2.0) + 0.2);
    geometry::write_cloud(folder_ / "map.ply", map);
    base::write_file(
        folder_ / "transform.json",
        R"({"matrix": [[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]], "scale": 1, "rmse": 0, "fitness": 1, "iterations": 1,
            "converged": true, "method": "point-to-mesh",
            "regions": {"found": false, "aligned_on": [{"center": [60, 0, 0], "size": [60, 60, 60]}],
                        "held_out": [{"center": [200, 0, 0], "size": [80, 60, 60]}]}})");
  }

  tests::TemporaryFolder folder_;
};

/// The files that evaluate() wrote.
struct Scored {
  std::string metrics, errors, seen;
};

Scored score(const fs::path& transform, const MapInputs& map, const fs::path& truth,
             const EvaluationSettings& settings) {
  const fs::path out = truth / "scores/metrics.json";
  fs::create_directories(out.parent_path());
  Scored scored;
  evaluate(map, truth, transform, settings, out);
  scored.metrics = base::read_text(out);
  scored.errors = base::read_text(out.parent_path() / "errors.ply");
  scored.seen = base::read_text(seen_surface_file(out));
  return scored;
}

TEST(EvaluateByBlock, HasTheScoresOfTheWholeToTheLastDigit) {
  const Valley valley;
  const fs::path whole = valley.extract("whole", std::nullopt);
  MapInputs without_camera = valley.map();
  without_camera.camera.clear();
  EvaluationSettings settings{.completeness_samples_per_m2 = 0.5};
  const Scored seen = score(valley.transform(), valley.map(), whole, settings);
  const Scored all = score(valley.transform(), without_camera, whole, settings);
  settings.cutoff_m = 0.6;  // below the floor's largest distance: the floor is measured again
  const Scored near = score(valley.transform(), valley.map(), whole, settings);
  ASSERT_GT(json::parse(seen.metrics)["surface"]["normals"]["judged"], 1000);
  EXPECT_LT(4 * seen.seen.size(), 3 * all.seen.size()) << "a part of the valley is seen";
  EXPECT_NE(near.metrics, seen.metrics);
  for (const double block_m : {7.0, 30.0, 1000.0}) {
    settings.cutoff_m = 1.0;
    const fs::path blocks = valley.extract("blocks" + std::to_string(block_m), block_m);
    ASSERT_TRUE(fs::exists(blocks / "index.json"));
    const Scored seen_by_block = score(valley.transform(), valley.map(), blocks, settings);
    EXPECT_EQ(seen_by_block.metrics, seen.metrics) << block_m;
    EXPECT_EQ(seen_by_block.errors, seen.errors) << block_m;
    EXPECT_EQ(seen_by_block.seen, seen.seen) << block_m;
    const Scored all_by_block = score(valley.transform(), without_camera, blocks, settings);
    EXPECT_EQ(all_by_block.metrics, all.metrics) << block_m;
    EXPECT_EQ(all_by_block.seen, all.seen) << block_m;
    settings.cutoff_m = 0.6;
    EXPECT_EQ(score(valley.transform(), valley.map(), blocks, settings).metrics, near.metrics) << block_m;
  }
}

TEST(AlignByBlock, ReadsWhatIsNearTheStart) {
  const Valley valley;
  const fs::path whole = valley.extract("whole", std::nullopt), blocks = valley.extract("blocks", 50.0);
  for (const bool all_evidence : {false, true}) {
    alignment::AlignMapOptions options;
    options.use_all_evidence = all_evidence;
    options.start = alignment::AlignmentStart::kTruePoses;
    const json of_whole = to_json(align(valley.map(), whole, options, valley / "a.json"));
    json of_blocks = to_json(align(valley.map(), blocks, options, valley / "b.json"));
    const json read = of_blocks["truth_blocks"];
    EXPECT_GT(read["of"], 20);
    EXPECT_GT(read["read"], 10);
    EXPECT_LT(read["read"].get<double>(), 0.9 * read["of"].get<double>());
    of_blocks.erase("truth_blocks");
    EXPECT_FALSE(of_whole.contains("truth_blocks"));
    EXPECT_EQ(of_blocks, of_whole) << "nothing is in reach of the map that was not read";
  }
  alignment::AlignMapOptions options;
  options.use_all_evidence = false;
  options.start = alignment::AlignmentStart::kAsItIs;
  MapInputs map = valley.map();
  map.trajectory.clear();
  const AlignResult as_it_is = align(map, blocks, options, valley / "b.json");
  EXPECT_LT(as_it_is.blocks_read, as_it_is.blocks) << "outliers do not count";
  options.start = alignment::AlignmentStart::kAuto;
  const AlignResult unknown = align(map, blocks, options, valley / "b.json");
  EXPECT_EQ(unknown.blocks_read, unknown.blocks);
}

TEST(EvaluateByBlock, HasTheScoresOfTheWholeOnARealPlace) {
  TILEFLIGHT_REQUIRE_TEST_DATA(place, "tilesets/machangara_photogrammetry/tileset.json");
  const tests::TemporaryFolder folder;
  const auto extract = [&](const std::string& name, std::optional<double> block_m) {
    place::extract({.source = place.string(), .load = {.error_m = 8.0}, .samples_per_m2 = 1.0, .block_m = block_m},
                   folder / name, false);
    return folder / name;
  };
  const fs::path whole = extract("whole", std::nullopt);
  PointCloud map = geometry::read_cloud(whole / "surface.ply");
  map.normals.clear();
  std::mt19937 random(5);
  std::normal_distribution<double> noise(0.0, 0.3);
  for (Vec3& p : map.positions) p += Vec3(noise(random), noise(random), noise(random));
  PointCloud part;
  for (std::size_t i = 0; i < map.size(); i += 1 + map.size() / 20000) part.positions.push_back(map.positions[i]);
  geometry::write_cloud(folder / "map.ply", part);
  base::write_file(folder / "transform.json",
                   R"({"matrix": [[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]], "scale": 1, "rmse": 0, "fitness": 1,
                       "iterations": 1, "converged": true, "method": "none"})");
  const EvaluationSettings settings{.completeness_samples_per_m2 = 0.5};
  const MapInputs inputs{.map = folder / "map.ply"};
  const Scored of_whole = score(folder / "transform.json", inputs, whole, settings);
  for (const double block_m : {60.0}) {
    const Scored of_blocks =
        score(folder / "transform.json", inputs, extract("blocks" + std::to_string(block_m), block_m), settings);
    EXPECT_EQ(of_blocks.metrics, of_whole.metrics) << block_m;
    EXPECT_EQ(of_blocks.errors, of_whole.errors) << block_m;
    EXPECT_EQ(of_blocks.seen, of_whole.seen) << block_m;
  }
}

}  // namespace
}  // namespace tileflight::scoring::evaluate_test
