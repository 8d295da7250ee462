// `align` and `evaluate` of maps that nobody knows the place of: from a mesh to its tiles, to its truth, and back.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "tests/rolling_ground.h"
#include "tests/run_program.h"
#include "tileflight/core/geometry/cloud_files.h"

namespace tileflight::align_command_test {
namespace {

using geometry::PointCloud;
using geometry::Sim3;
using geometry::Vec3;
using nlohmann::json;
using ::testing::HasSubstr;
using tests::ProgramResult;
using tests::run_tileflight;

json read_json(const std::filesystem::path& file) { return json::parse(tests::file_text(file)); }

class AlignCommand : public ::testing::Test {
 protected:
  AlignCommand() { tests::rolling_ground().copy_to(folder_.path()); }

  void run(const std::vector<std::string>& arguments) {
    const ProgramResult result = run_tileflight(arguments);
    ASSERT_EQ(result.exit_code, 0) << result.err;
  }

  json align(const std::vector<std::string>& more) { return align_file("map.ply", more); }
  json align_file(const std::string& map, const std::vector<std::string>& more) {
    std::vector<std::string> arguments = {"align", path(map), "--to", path("truth"), "--out", path("transform.json")};
    arguments.insert(arguments.end(), more.begin(), more.end());
    run(arguments);
    return read_json(folder_ / "transform.json");
  }
  /// Each fourth point of the map, as "quarter.ply".
  void write_quarter() const {
    const PointCloud map = geometry::read_cloud(folder_ / "map.ply");
    PointCloud quarter;
    for (std::size_t i = 0; i < map.size(); i += 4) quarter.positions.push_back(map.positions[i]);
    geometry::write_cloud(folder_ / "quarter.ply", quarter);
  }

  /// Copies the last transform to a start file, because a command never overwrites a file that it reads.
  std::string start_from_the_last() const {
    std::filesystem::copy_file(folder_ / "transform.json", folder_ / "start.json",
                               std::filesystem::copy_options::overwrite_existing);
    return path("start.json");
  }

  /// Returns the largest distance of the map's corners, moved by a transform, from their true places.
  static double error_m(const json& transform) {
    geometry::Mat4 matrix;
    for (int r = 0; r < 4; ++r) {
      for (int c = 0; c < 4; ++c)
        matrix(r, c) = transform.at("matrix").at(static_cast<std::size_t>(r)).at(static_cast<std::size_t>(c));
    }
    const Sim3 T = Sim3::from_matrix(matrix);
    double most_m = 0.0;
    for (const double x : {-48.0, 48.0}) {
      for (const double y : {-48.0, 48.0}) {
        const Vec3 p(x, y, 0.0);
        most_m = std::max(most_m, (T * (tests::kTrueOfRollingGround.inverse() * p) - p).norm());
      }
    }
    return most_m;
  }

  std::string path(const std::string& name) const { return (folder_ / name).string(); }

  tests::TemporaryFolder folder_;
};

TEST_F(AlignCommand, FindsTheMapsPlaceWithoutAStart) {
  const json by_geometry = align({"--start", "geometry", "--method", "point-to-mesh"});
  EXPECT_EQ(by_geometry.at("start"), "geometry");
  EXPECT_LT(error_m(by_geometry), 0.05) << by_geometry.at("note");
  EXPECT_TRUE(by_geometry.at("converged"));
  EXPECT_GT(by_geometry.at("closeness").get<double>(), 0.9);
  EXPECT_LT(by_geometry.at("uncertainty").at("rms_motion_sigma").get<double>(), 0.05);
  EXPECT_EQ(by_geometry.at("uncertainty").at("covariance").size(), 7u);

  // ICP moves the map until it gives up, in time that grows with the number of points. A quarter of them is enough.
  write_quarter();
  const json by_itself = align_file("quarter.ply", {"--method", "point-to-mesh"});
  EXPECT_EQ(by_itself.at("start"), "geometry") << "as it is, a map a twelfth of the size fits anywhere";
  EXPECT_LT(error_m(by_itself), 0.05);

  const json given = align({"--start", start_from_the_last(), "--method", "generalized"});
  EXPECT_EQ(given.at("start"), "given");
  EXPECT_EQ(given.at("method"), "icp-generalized");
  EXPECT_LT(error_m(given), 0.05);
}

// A map whose lengths are 0.4 % too long, a little off its place: the scale of a metric one is held, and its error
// told.
TEST_F(AlignCommand, TheScaleOfAMetricMapIsHeldAndItsErrorTold) {
  const PointCloud map = transformed(tests::kTrueOfRollingGround, geometry::read_cloud(folder_ / "map.ply"));
  std::filesystem::create_directories(folder_ / "odometry");
  geometry::write_cloud(folder_ / "odometry/map.ply",
                        transformed(Sim3(1.004, geometry::so3_exp({0.0, 0.0, 0.01}), {0.5, -0.3, 0.2}), map));
  const auto align_as = [&](const std::string& scale) {
    std::ofstream(folder_ / "odometry/odometry.json") << R"({"scale": ")" << scale << R"(", "warnings": []})";
    run({"align", path("odometry"), "--to", path("truth"), "--out", path("metric.json")});
    return read_json(folder_ / "metric.json");
  };
  const json free = align_as("unknown");
  EXPECT_NEAR(free.at("scale").get<double>(), 1.0 / 1.004, 3e-4);
  EXPECT_FALSE(free.contains("scale_error"));
  const json held = align_as("metric");
  EXPECT_NEAR(held.at("scale").get<double>(), 1.0, 1e-9);
  EXPECT_NEAR(held.at("scale_error").get<double>(), 0.004, 5e-4);
}

TEST_F(AlignCommand, RegionsAreAlignedOnAndHeldOut) {
  const json transform = align({"--start", "geometry", "--method", "point-to-mesh", "--find-regions"});
  EXPECT_LT(error_m(transform), 0.05) << transform.at("note");
  const json& regions = transform.at("regions");
  EXPECT_TRUE(regions.at("found"));
  EXPECT_GE(regions.at("aligned_on").size(), 2u);
  EXPECT_GE(regions.at("held_out").size(), 2u);
  run({"evaluate", path("map.ply"), "--truth", path("truth"), "--transform", path("transform.json"), "--out",
       path("metrics.json")});
  const json scores = read_json(folder_ / "metrics.json").at("regions");
  EXPECT_EQ(scores.at("each").size(), regions.at("aligned_on").size() + regions.at("held_out").size());
  EXPECT_GT(scores.at("held_out").at("points").get<int>(), 100);
  EXPECT_LT(scores.at("held_out").at("median").get<double>(), 0.05);
}

TEST_F(AlignCommand, PaperPresetIsThePapersAlone) {
  align({"--start", "geometry"});
  const json paper = align({"--preset", "paper", "--start", start_from_the_last()});
  EXPECT_TRUE(paper.at("steps").empty());
  EXPECT_EQ(paper.at("method"), "icp-point-to-point");
}

TEST_F(AlignCommand, BadOptionsAreOneLine) {
  const std::vector<std::string> base = {"align", path("map.ply"), "--to", path("truth"), "--out", path("t.json")};
  const auto with = [&](const std::vector<std::string>& more) {
    std::vector<std::string> arguments = base;
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run_tileflight(arguments);
  };
  EXPECT_EQ(with({"--preset", "papers"}).exit_code, 2);
  EXPECT_EQ(with({"--method", "icp"}).exit_code, 2);
  EXPECT_EQ(with({"--radius", "-1"}).exit_code, 2);
  const ProgramResult up = with({"--up", "0,0,0", "--start", "geometry"});
  EXPECT_EQ(up.exit_code, 1);
  EXPECT_THAT(up.err, HasSubstr("--up: must be a direction"));
  EXPECT_THAT(with({"--start", path("nowhere.json")}).err, HasSubstr("nowhere.json"));
  EXPECT_FALSE(std::filesystem::exists(path("t.json")));
}

TEST_F(AlignCommand, AStartWhoseMapIsElsewhereOrInOtherUnitsIsRefusedAtOnce) {
  const PointCloud placed = geometry::transformed(tests::kTrueOfRollingGround, geometry::read_cloud(path("map.ply")));
  const auto refusal = [&](const Sim3& T) {
    geometry::write_cloud(folder_ / "far.ply", geometry::transformed(T, placed));
    const ProgramResult result = run_tileflight(
        {"align", path("far.ply"), "--to", path("truth"), "--start", "as-it-is", "--out", path("far.json")});
    EXPECT_EQ(result.exit_code, 1);
    EXPECT_EQ(tests::line_count(result.err), 1) << result.err;
    return result.err;
  };
  const Eigen::Quaterniond same = Eigen::Quaterniond::Identity();
  EXPECT_THAT(refusal({1.0, same, {5000.0, 0.0, 0.0}}), HasSubstr("map: 0 of its "));
  EXPECT_THAT(refusal({1000.0, same, {0.0, 0.0, 0.0}}), HasSubstr("its coordinates or units are others"));
  EXPECT_THAT(refusal({0.001, same, {0.0, 0.0, 0.0}}), HasSubstr("less than the distance of a correspondence (1 m"));
}

TEST_F(AlignCommand, TakesATruthInBlocksThatIsTheSame) {
  for (const std::string edge : {"33.3", "auto", "20"}) {
    json whole = read_json(folder_ / "truth/extract.json");
    run({"extract", whole.at("source"), "--block", edge, "--out", path("blocks"), "--force"});
    json blocks = read_json(folder_ / "blocks/extract.json");
    whole.erase("seconds");
    blocks.erase("seconds");
    EXPECT_EQ(blocks, whole);
    std::size_t triangles = 0, voxels = 0;
    const json index = read_json(folder_ / "blocks/index.json");
    for (const json& block : index["blocks"]) {
      triangles += block["triangles"].get<std::size_t>();
      voxels += block["voxels_occupied"].get<std::size_t>();
      EXPECT_TRUE(std::filesystem::exists(folder_ / "blocks" / block["folder"].get<std::string>() / "voxels.binvox"));
    }
    EXPECT_EQ(triangles, whole["triangles"]);
    EXPECT_EQ(voxels, whole["voxels_occupied"]);
  }
  EXPECT_GE(read_json(folder_ / "blocks/index.json")["blocks"].size(), 25U);
  const json to_whole = align({"--start", "geometry"});
  run({"align", path("map.ply"), "--to", path("blocks"), "--start", "geometry", "--out", path("blocks.json")});
  json to_blocks = read_json(folder_ / "blocks.json");
  EXPECT_EQ(to_blocks["truth_blocks"]["read"], to_blocks["truth_blocks"]["of"]) << "the map may be anywhere";
  to_blocks.erase("truth_blocks");
  EXPECT_EQ(to_blocks, to_whole);
  for (const std::string truth : {"truth", "blocks"}) {
    run({"evaluate", path("map.ply"), "--truth", path(truth), "--transform", path("transform.json"), "--out",
         path(truth + "-metrics.json")});
  }
  EXPECT_EQ(tests::file_text(folder_ / "blocks-metrics.json"), tests::file_text(folder_ / "truth-metrics.json"));
}

}  // namespace
}  // namespace tileflight::align_command_test
