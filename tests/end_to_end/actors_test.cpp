// `render` with actors in the flight: pictures, masks, boxes, optical flow and COCO's file, for any number of parts.
#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>

#include "tests/run_program.h"
#include "tests/same_files.h"
#include "tests/tiny_place.h"
#include "tileflight/core/imaging/image_files.h"
#include "tileflight/data/dataset/dataset.h"

namespace tileflight::actors_test {
namespace {

using geometry::SE3;
using geometry::Vec3;
using nlohmann::json;
using tests::run_tileflight;
using tests::TinyPlace;

constexpr const char* kFlight = R"(camera: camera.yaml
fps: 4
speed_m_s: 4
max_frames: 4
waypoints:
  - {position: [-10, -18, 112], yaw_deg: 20, pitch_deg: -30}
  - {position: [10, -15, 113], yaw_deg: 30, pitch_deg: -35}
)";
constexpr const char* kActors = R"(actors:
  - {name: taxi, model: car, color: [240, 200, 0], speed_m_s: 6, scale: 1.5, path: [{at: [-16, -4]}, {at: [0, 2]}, {at: [16, 0]}]}
  - {name: Ann, model: person, scale: 3, path: [{at: [2, -6]}, {at: [-6, 2]}], start_s: -1}
  - {name: kite, model: sphere, on_ground: false, position: [0, 4, 107], scale: 2}
)";

class Actors : public ::testing::Test {
 protected:
  Actors() {
    TinyPlace::write(folder_ / "place");
    TinyPlace::write_file(folder_ / "camera.yaml", TinyPlace::kCamera);
    TinyPlace::write_file(folder_ / "bare.yaml", kFlight);
    TinyPlace::write_file(folder_ / "flight.yaml", std::string(kFlight) + kActors);
  }
  tests::ProgramResult render(const std::string& out, const std::string& flight, const std::vector<std::string>& more) {
    std::vector<std::string> call{"render", (folder_ / "place").string(), "--flight", (folder_ / flight).string(),
                                  "--out",  (folder_ / out).string(),     "--json"};
    call.insert(call.end(), more.begin(), more.end());
    return run_tileflight(call);
  }
  json read(const std::filesystem::path& file) const { return json::parse(std::ifstream(folder_ / file)); }

  tests::TemporaryFolder folder_;
};

Vec3 vec3(const json& v) { return {v[0].get<double>(), v[1].get<double>(), v[2].get<double>()}; }
SE3 pose_of(const json& box) {
  const json& q = box["rotation"];
  return {Eigen::Quaterniond(q[3].get<double>(), q[0].get<double>(), q[1].get<double>(), q[2].get<double>()),
          vec3(box["center"])};
}

/// From its depth, and the boxes of this frame and the next alone.
TEST_F(Actors, FlowOfMovingThingsIsWhereTheirPointsGo) {
  const auto result = render("out", "flight.yaml", {"--outputs", "segmentation,flow,depth"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const dataset::Dataset out = dataset::read_dataset(folder_ / "out");
  const imaging::Camera& camera = out.calibration.camera;
  std::map<std::string, int> ids;
  std::ifstream table(folder_ / "out" / "segmentation.csv");
  for (std::string line; std::getline(table, line);) {
    const std::size_t comma = line.find(',');
    ids[line.substr(comma + 1, line.find(',', comma + 1) - comma - 1)] = std::atoi(line.c_str());
  }
  int checked = 0, moving = 0;
  for (std::size_t frame = 0; frame + 1 < out.frames.size(); ++frame) {
    const std::string name = "00000" + std::to_string(frame);
    const auto flow_u = imaging::read_exr_channel(folder_ / "out" / "flow" / (name + ".exr"), "R");
    const auto flow_v = imaging::read_exr_channel(folder_ / "out" / "flow" / (name + ".exr"), "G");
    const imaging::FloatImage depth = imaging::read_exr(folder_ / "out" / "depth" / (name + ".exr"));
    const json now = read("out/boxes/" + name + ".json"),
               next = read("out/boxes/00000" + std::to_string(frame + 1) + ".json");
    const SE3 T0 = out.groundtruth->poses[frame].T_local_camera, T1 = out.groundtruth->poses[frame + 1].T_local_camera;
    const auto ids_image = imaging::read_gray16(folder_ / "out" / "segmentation" / (name + ".png"));
    for (std::size_t actor = 0; actor < 3; ++actor) {
      const SE3 moved = pose_of(next["boxes"][actor]) * pose_of(now["boxes"][actor]).inverse();
      const int id = ids.at(now["boxes"][actor]["actor"]);
      for (int y = 0; y < camera.height(); ++y) {
        for (int x = 0; x < camera.width(); ++x) {
          if (ids_image(x, y) != id) continue;
          const auto ray = camera.unproject({x, y});
          const float d = depth(x, y);
          const Vec3 point = T0 * (*ray * (static_cast<double>(d) / ray->z()));
          const auto pixel = camera.project(T1.inverse() * (moved * point));
          const float u = flow_u(x, y), v = flow_v(x, y);
          if (!pixel || std::isnan(u)) continue;
          EXPECT_NEAR(u, pixel->x() - x, 0.01);
          EXPECT_NEAR(v, pixel->y() - y, 0.01);
          ++checked;
          moving += actor == 0 ? 1 : 0;
        }
      }
    }
  }
  EXPECT_GT(checked, 300);
  EXPECT_GT(moving, 100);
}

TEST_F(Actors, BoxesHoldTheirPixelsAndCocosFileIsOfThem) {
  ASSERT_EQ(render("out", "flight.yaml", {"--outputs", "segmentation"}).exit_code, 0);
  const dataset::Dataset out = dataset::read_dataset(folder_ / "out");
  const imaging::Camera& camera = out.calibration.camera;
  const json coco = read("out/coco.json");
  EXPECT_EQ(coco["images"].size(), out.frames.size());
  ASSERT_GT(coco["annotations"].size(), 5U);
  for (const json& one : coco["annotations"]) {
    const json& bbox = one["bbox"];
    const int x0 = bbox[0], y0 = bbox[1], x1 = x0 + bbox[2].get<int>(), y1 = y0 + bbox[3].get<int>();
    // The mask, run by run down the columns.
    std::int64_t at = 0, area = 0;
    bool inside = false;
    for (const json& run : one["segmentation"]["counts"]) {
      for (std::int64_t i = at; inside && i < at + run.get<std::int64_t>(); ++i) {
        const auto x = static_cast<int>(i / camera.height()), y = static_cast<int>(i % camera.height());
        EXPECT_TRUE(x >= x0 && x < x1 && y >= y0 && y < y1);
        ++area;
      }
      at += run.get<std::int64_t>();
      inside = !inside;
    }
    EXPECT_EQ(at, std::int64_t{camera.width()} * camera.height());
    EXPECT_EQ(area, one["area"]);
    // The projected corners of the box in space are around it.
    const json& box = one["box3d"];
    const SE3 T_local_camera = out.groundtruth->poses[one["image_id"]].T_local_camera;
    double left = 1e9, right = -1e9, top = 1e9, bottom = -1e9;
    for (int i = 0; i < 8; ++i) {
      const Vec3 corner =
          pose_of(box) * (0.5 * vec3(box["size"]).cwiseProduct(Vec3(i & 1 ? 1 : -1, i & 2 ? 1 : -1, i & 4 ? 1 : -1)));
      const auto pixel = camera.project(T_local_camera.inverse() * corner);
      if (!pixel) continue;
      left = std::min(left, pixel->x()), right = std::max(right, pixel->x());
      top = std::min(top, pixel->y()), bottom = std::max(bottom, pixel->y());
    }
    EXPECT_LE(left, x0 + 2.0);
    EXPECT_GE(right, x1 - 3.0);
    EXPECT_LE(top, y0 + 2.0);
    EXPECT_GE(bottom, y1 - 3.0);
    EXPECT_LT((T_local_camera.inverse() * vec3(box["center"]) - vec3(box["center_camera"])).norm(), 1e-6);
  }
  // Velocities are those of the centres; the car stands on the ground.
  const json first = read("out/boxes/000000.json"), second = read("out/boxes/000001.json");
  const double dt = second["time_s"].get<double>() - first["time_s"].get<double>();
  const Vec3 way = vec3(second["boxes"][0]["center"]) - vec3(first["boxes"][0]["center"]);
  EXPECT_NEAR(way.norm() / dt, vec3(first["boxes"][0]["velocity_m_s"]).norm(), 0.3);
  EXPECT_NEAR(way.norm() / dt, 6.0, 0.6) << "its speed is by the map; slopes add a little";
  const Vec3 car = vec3(second["boxes"][0]["center"]);
  EXPECT_NEAR(car.z() - 0.5 * 1.5 * 1.45, TinyPlace::height(car.x(), car.y()), 0.3);
}

TEST_F(Actors, TheSameBytesForAnyNumberOfThreadsAndAPlaceWithoutThemIsAsBefore) {
  const std::vector<std::string> outputs{"--outputs", "segmentation,flow,depth,normals"};
  auto one = outputs, two = outputs;
  one.insert(one.end(), {"--threads", "1"});
  two.insert(two.end(), {"--threads", "2"});
  ASSERT_EQ(render("one", "flight.yaml", one).exit_code, 0);
  ASSERT_EQ(render("two", "flight.yaml", two).exit_code, 0);
  tests::expect_same_files(folder_ / "one", folder_ / "two");
  // Boxes and masks do not depend on the outputs asked for: without a segmentation, only pixels around actors are
  // looked at.
  ASSERT_EQ(render("pictures", "flight.yaml", {}).exit_code, 0);
  EXPECT_EQ(read("pictures/coco.json"), read("one/coco.json"));
  ASSERT_EQ(render("bare", "bare.yaml", outputs).exit_code, 0);
  EXPECT_FALSE(std::filesystem::exists(folder_ / "bare" / "coco.json"));
  const auto with = imaging::read_gray16(folder_ / "one" / "segmentation" / "000002.png");
  const auto without = imaging::read_exr(folder_ / "bare" / "depth" / "000002.exr");
  const auto depth = imaging::read_exr(folder_ / "one" / "depth" / "000002.exr");
  int different = 0;
  for (std::size_t i = 0; i < depth.pixels.size(); ++i) different += depth.pixels[i] != without.pixels[i] ? 1 : 0;
  EXPECT_GT(different, 50);
  EXPECT_LT(different, static_cast<int>(depth.pixels.size()) / 5) << "the ground is where it was, to the last bit";
  EXPECT_EQ(with.pixels.size(), depth.pixels.size());
}

TEST_F(Actors, AWrongOneIsNamed) {
  TinyPlace::write_file(folder_ / "wrong.yaml",
                        std::string(kFlight) + "actors:\n  - {name: far, position: [4000, 0]}\n");
  const auto far = render("wrong", "wrong.yaml", {});
  EXPECT_EQ(far.exit_code, 1);
  EXPECT_THAT(far.err, ::testing::HasSubstr("far: there is no surface below its path"));
  TinyPlace::write_file(folder_ / "wrong.yaml",
                        std::string(kFlight) + "actors:\n  - {model: tank, position: [0, 0]}\n");
  EXPECT_THAT(render("wrong", "wrong.yaml", {}).err, ::testing::HasSubstr("model"));
}

TEST_F(Actors, InTheCamerasWayAreAWarning) {
  TinyPlace::write_file(folder_ / "through.yaml", R"(camera: camera.yaml
fps: 4
speed_m_s: 4
max_frames: 8
waypoints:
  - {position: [-4, 0, 109], yaw_deg: 90, pitch_deg: -20}
  - {position: [6, 0, 109], yaw_deg: 90, pitch_deg: -20}
actors:
  - {name: kite, model: box, on_ground: false, position: [0, 0, 109], scale: 3}
)");
  const auto told = render("through", "through.yaml", {});
  ASSERT_EQ(told.exit_code, 0) << told.err;
  EXPECT_THAT(told.out, ::testing::HasSubstr("the camera is inside an actor (kite)"));
  EXPECT_THAT(told.out, ::testing::HasSubstr("goes through an actor (kite)"));
  const dataset::Dataset out = dataset::read_dataset(folder_ / "through");
  EXPECT_TRUE(out.metadata.contains("warnings.camera_inside_actor"));
  ASSERT_EQ(render("away", "flight.yaml", {}).exit_code, 0);
  EXPECT_FALSE(dataset::read_dataset(folder_ / "away").metadata.contains("warnings.camera_inside_actor"));
}

TEST_F(Actors, StopAVehicle) {
  const auto mission = [&](const char* name, double kite_east) {
    TinyPlace::write_file(folder_ / name, R"(camera: camera.yaml
fps: 4
mission:
  - {do: go_to, position: [12, 0, 112], speed_m_s: 4}
vehicle: {start: [-8, 0, 112], collision: stop, radius_m: 0.4}
actors:
  - {name: kite, model: box, on_ground: false, scale: 4, speed_m_s: 1, path: [{at: [)" +
                                              std::to_string(kite_east) + ", 0, 112]}, {at: [" +
                                              std::to_string(kite_east + 3) + ", 0, 112]}]}\n");
    const auto told = render(std::string(name) + ".out", name, {});
    EXPECT_EQ(told.exit_code, 0) << told.err;
    return read(std::string(name) + ".out/vehicle.json");
  };
  const json met = mission("met.yaml", 2.0);
  EXPECT_EQ(met["outcome"], "collided");
  EXPECT_EQ(met["last_collision"]["actor"], "kite");
  // The box's western side, which has gone on at 1 m/s for up to three metres.
  const double at_s = met["last_collision"]["time_s"];
  EXPECT_NEAR(met["last_collision"]["point"][0].get<double>(), 2.0 - 2.0 + std::min(3.0, at_s), 0.15);
  EXPECT_GT(at_s, 1.0);
  EXPECT_NEAR(std::abs(met["last_collision"]["normal"][0].get<double>()), 1.0, 1e-3);
  EXPECT_EQ(mission("clear.yaml", 30.0)["outcome"], "finished");
}

}  // namespace
}  // namespace tileflight::actors_test
