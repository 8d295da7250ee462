// A flight over cars on their ways and parked ones: the points that the odometry puts on them are no part of the
// scores.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "tests/run_program.h"
#include "tests/shared_stadium.h"
#include "tests/temporary_folder.h"
#include "tileflight/core/geometry/cloud_files.h"
#include "tileflight/core/geometry/trajectory.h"

namespace tileflight::moving_points_test {
namespace {

namespace fs = std::filesystem;
using geometry::Vec3;
using nlohmann::json;

constexpr const char* kCamera = R"(cam0:
  camera_model: pinhole
  intrinsics: [336.0, 336.0, 335.5, 188.5]
  distortion_model: none
  distortion_coeffs: []
  resolution: [672, 378]
)";

/// The flight of examples/stadium-traffic.yaml at a third of its height, with parked cars in rows.
std::string flight() {
  std::string text = R"(camera: camera.yaml
fps: 10
max_frames: 30
speed_m_s: 2
acceleration_m_s2: 1.5
waypoints:
  - {position: [-110.8, -136.6, 17], yaw_deg: -21, pitch_deg: -33}
  - {position: [-114.8, -129.1, 16], yaw_deg: -26, pitch_deg: -33}
  - {position: [-117.8, -121.9, 15], yaw_deg: -33, pitch_deg: -33}
actors:
  - {name: east, model: car, number: 3, speed_m_s: 9, start_s: -6, path: [{at: [-222.9, -79.3]}, {at: [-129.4, -98.5]}, {at: [55.2, -144.4]}]}
  - {name: walker, model: person, path: [{at: [-125.7, -110.1]}, {at: [-120.2, -88.7]}]}
)";
  for (int i = 0; i < 12; ++i) {
    const double east = -132 + 3.2 * (i % 6), north = -112 + 8.0 * (i / 6);
    text += "  - {name: parked_" + std::to_string(i) + ", model: " + (i % 3 == 0 ? "van" : "car") +
            ", number: " + std::to_string(i) + ", position: [" + std::to_string(east) + ", " + std::to_string(north) +
            "], yaw_deg: 17}\n";
  }
  return text;
}

class MovingPoints : public testing::Test {
 protected:
  void call(std::vector<std::string> arguments) const {
    arguments.emplace_back("--quiet");
    const auto ended = tests::run_tileflight(arguments);
    ASSERT_EQ(ended.exit_code, 0) << ended.err;
  }
  std::string path(const char* name) const { return (folder_ / name).string(); }
  json scores(const char* folder) const {
    fs::create_directories(folder_ / folder);
    const std::string file = (folder_ / folder / "metrics.json").string();
    call({"evaluate", path("odometry"), "--truth", path("truth"), "--transform", path("transform.json"), "--dataset",
          path("dataset"), "--out", file});
    return json::parse(std::ifstream(file));
  }
  /// Whether a point is in a box with its margins, by the box's own numbers.
  static bool is_on(const json& box, const Vec3& p) {
    const auto at = [](const json& v) { return Vec3(v[0].get<double>(), v[1].get<double>(), v[2].get<double>()); };
    const json& q = box["rotation"];
    const Eigen::Quaterniond rotation(q[3].get<double>(), q[0].get<double>(), q[1].get<double>(), q[2].get<double>());
    const Vec3 own = rotation.conjugate() * (p - at(box["center"])), half = at(box["size"]) / 2;
    return std::abs(own.x()) < half.x() + 0.2 && std::abs(own.y()) < half.y() + 0.2 && own.z() < half.z() + 0.2 &&
           own.z() > -half.z() + std::min(0.3, 2 * half.z() / 3);
  }
  /// By hand: the points of the map in a box of the frame whose time their keyframe has.
  std::size_t points_on_actors() const {
    const geometry::PointCloud map = geometry::read_cloud(folder_ / "odometry/map.ply");
    const geometry::Trajectory keyframes = geometry::read_tum(folder_ / "odometry/keyframes.txt");
    const json transform = json::parse(std::ifstream(folder_ / "transform.json"));
    const json& m = transform.contains("to_surface") ? transform["to_surface"]["matrix"] : transform["matrix"];
    std::size_t count = 0;
    for (std::size_t i = 0; i < map.size(); ++i) {
      Vec3 p;
      for (int r = 0; r < 3; ++r) {
        p[r] = m[r][3].get<double>();
        for (int c = 0; c < 3; ++c) p[r] += m[r][c].get<double>() * map.positions[i][c];
      }
      const double time_s = keyframes.poses[static_cast<std::size_t>(map.scalars.at("keyframe")[i])].time_s;
      char name[40];
      std::snprintf(name, sizeof name, "dataset/boxes/%06d.json", static_cast<int>(std::lround(time_s * 10)));
      const json frame = json::parse(std::ifstream(folder_ / name));
      EXPECT_NEAR(frame["time_s"].get<double>(), time_s, 1e-3);
      bool on = false;
      for (const json& box : frame["boxes"]) on = on || is_on(box, p);
      count += on ? 1 : 0;
    }
    return count;
  }

  tests::TemporaryFolder folder_;
};

TEST_F(MovingPoints, AreCountedApart) {
  std::ofstream(folder_ / "camera.yaml") << kCamera;
  std::ofstream(folder_ / "flight.yaml") << flight();
  const std::string origin = "35.310344,-80.740007,190";
  const std::string place = (tests::shared_stadium().made() / "twin").string();
  call({"render", place, "--origin", origin, "--flight", path("flight.yaml"), "--out", path("dataset")});
  call({"odometry", path("dataset"), "--out", path("odometry"), "--no-check"});
  call({"extract", place, "--origin", origin, "--center-local", "-110,-100,0", "--size", "260,220,80", "--out",
        path("truth")});
  call({"align", path("odometry"), "--dataset", path("dataset"), "--to", path("truth"), "--start", "true-poses",
        "--out", path("transform.json")});
  const json with = scores("with");
  const json& moving = with["moving_objects"];
  const std::size_t on = points_on_actors();
  EXPECT_GT(on, 50U);
  EXPECT_EQ(moving["points"], on);
  EXPECT_EQ(moving["objects"], 14);
  EXPECT_EQ(moving["at"], "keyframe");
  EXPECT_GT(moving["surface"]["mean"], 2 * with["surface"]["mean"].get<double>()) << "the truth has no cars";
  EXPECT_LT(with["surface"]["rmse"], moving["with_them"]["surface"]["rmse"]);
  EXPECT_EQ(geometry::read_cloud(folder_ / "with/moving.ply").size(), on);
  const std::size_t kept = geometry::read_cloud(folder_ / "with/errors.ply").size();
  EXPECT_EQ(with["map"]["points"], kept);
  // Without the boxes, every point counts, to the same scores as with them.
  fs::rename(folder_ / "dataset/boxes", folder_ / "boxes");
  fs::create_directories(folder_ / "without");
  fs::copy(folder_ / "with/moving.ply", folder_ / "without/moving.ply");
  const json without = scores("without");
  EXPECT_FALSE(without.contains("moving_objects"));
  EXPECT_FALSE(fs::exists(folder_ / "without/moving.ply")) << "nothing of an earlier score remains";
  EXPECT_EQ(without["map"]["points"], kept + on);
  EXPECT_EQ(moving["with_them"]["points"], kept + on);
  EXPECT_NEAR(without["map"]["mean"], moving["with_them"]["voxel"]["mean"], 1e-9);
  for (const char* key : {"points", "mean", "median", "rmse"})
    EXPECT_NEAR(without["surface"][key], moving["with_them"]["surface"][key], 1e-9) << key;
}

}  // namespace
}  // namespace tileflight::moving_points_test
