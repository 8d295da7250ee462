// `render` of several cameras on one body: one dataset, as each camera alone would give it.
#include "tileflight/data/dataset/rig.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "tests/run_program.h"
#include "tests/same_files.h"
#include "tests/tiny_city.h"
#include "tests/tiny_place.h"
#include "tileflight/core/imaging/image_files.h"
#include "tileflight/data/dataset/frame_layers.h"
#include "tileflight/data/dataset/sensor_files.h"

namespace tileflight::rig_test {
namespace {

namespace fs = std::filesystem;
using geometry::SE3;
using geometry::Vec2;
using geometry::Vec3;
using nlohmann::json;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using tests::file_text;
using tests::ProgramResult;
using tests::run_tileflight;
using tests::TinyPlace;

const std::string kPath = TinyPlace::path_with_sensors(7);
constexpr const char* kLeft = "  - {name: left, camera: camera.yaml}\n";
constexpr const char* kRight = "  - {name: right, camera: camera.yaml, position: [0.5, 0.1, 0], yaw_deg: 4}\n";
constexpr const char* kDown =
    "  - {name: down, camera: camera.yaml, resolution: [160, 120], pitch_deg: -60, fps: 4, degrade: {vignetting: "
    "0.3}}\n";
constexpr const char* kDegrade = R"(exposure_time: 0.002
exposure_samples: 3
line_delay: 0.00005
auto_exposure: {target: 0.25, time_constant: 0.2}
)";
constexpr const char* kNoise = "white_electrons: 5000\nread_noise_electrons: 4\n";

class RenderedRig : public ::testing::Test {
 protected:
  RenderedRig() {
    TinyPlace::write(folder_ / "place");
    TinyPlace::write_file(folder_ / "camera.yaml", TinyPlace::kCamera);
    TinyPlace::write_file(folder_ / "degrade.yaml", kDegrade);
    TinyPlace::write_file(folder_ / "noisy.yaml", std::string(kDegrade) + kNoise);
    write_flight("rig", std::string("cameras:\n") + kLeft + kRight + kDown);
  }

  void write_flight(const std::string& name, const std::string& cameras) const {
    TinyPlace::write_file(folder_ / (name + ".yaml"), cameras + kPath);
  }
  std::vector<std::string> call(const std::string& flight, const std::string& out,
                                const std::vector<std::string>& more) const {
    std::vector<std::string> words{"render",
                                   (folder_ / "place").string(),
                                   "--flight",
                                   (folder_ / (flight + ".yaml")).string(),
                                   "--out",
                                   (folder_ / out).string(),
                                   "--json",
                                   "--outputs",
                                   "depth,normals,segmentation,flow"};
    words.insert(words.end(), more.begin(), more.end());
    return words;
  }
  json render(const std::string& flight, const std::string& out, const std::vector<std::string>& more = {}) const {
    const ProgramResult result = run_tileflight(call(flight, out, more));
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return result.exit_code == 0 ? json::parse(result.out) : json();
  }
  std::vector<std::string> with(const char* degrade) const {
    return {"--degrade", (folder_ / degrade).string(), "--size", "1000,1000,1000", "--center-local", "0,0,100"};
  }
  /// All files of one camera alone, but for what names flight, rig and frames of other clocks.
  void expect_same_camera(const fs::path& one, const fs::path& other) const {
    std::size_t compared = 0;
    for (const std::string& file : tests::files_of(one)) {
      const std::string top = *fs::path(file).begin();
      if (top == "cameras" || top == "camchain.yaml" || top == "dataset.yaml" || top[0] == '.') continue;
      if (top == "camera.yaml" && one.filename() != "plain") continue;  // alone, the IMU is at this camera
      if (!fs::exists(other / file) && (top.starts_with("imu") || top == "lidar")) continue;  // of the body
      EXPECT_TRUE(file_text(one / file) == file_text(other / file)) << one << " " << file;
      ++compared;
    }
    EXPECT_GT(compared, 10U);
  }

  tests::TemporaryFolder folder_;
};

TEST_F(RenderedRig, HasOfEachCameraWhatItTakesAlone) {
  const json told = render("rig", "rig", with("degrade.yaml"));
  EXPECT_EQ(told["cameras"], 3);
  EXPECT_EQ(told["frames"], 7 + 7 + 4);
  write_flight("left", std::string("cameras:\n") + kLeft);
  write_flight("right", std::string("cameras:\n") + kRight);
  write_flight("down", std::string("cameras:\n") + kDown);
  write_flight("plain", "camera: camera.yaml\n");
  for (const char* alone : {"left", "right", "down", "plain"}) render(alone, alone, with("degrade.yaml"));
  expect_same_camera(folder_ / "left", folder_ / "rig");
  expect_same_camera(folder_ / "right", folder_ / "rig/cameras/right");
  expect_same_camera(folder_ / "down", folder_ / "rig/cameras/down");
  expect_same_camera(folder_ / "plain", folder_ / "left");
  EXPECT_FALSE(fs::exists(folder_ / "plain/camchain.yaml"));
  EXPECT_FALSE(fs::exists(folder_ / "rig/cameras/right/imu.csv")) << "the body has one inertial unit";
}

TEST_F(RenderedRig, IsTheSameRigWhenItsPicturesAreIngested) {
  write_flight("pair", std::string("cameras:\n") + kLeft + kDown);
  const fs::path rig = folder_ / "pair";
  render("pair", "pair");
  const auto ingest = [&](const std::vector<std::string>& more) {
    std::vector<std::string> words{
        "ingest",  "--camera",      (rig / "camchain.yaml").string(),  "--out", (folder_ / "again").string(), "--json",
        "--force", "--groundtruth", (rig / "groundtruth.txt").string()};
    words.insert(words.end(), more.begin(), more.end());
    return run_tileflight(words);
  };
  const ProgramResult told = ingest({"down=" + (rig / "cameras/down").string(), "left=" + rig.string()});
  ASSERT_EQ(told.exit_code, 0) << told.err;
  const json found = json::parse(told.out);
  EXPECT_EQ(found["warnings"], json::array());
  EXPECT_EQ(found["synchronisation"]["cameras"][1]["matched"], 4);
  for (const char* file : {"times.txt", "camera.yaml", "camera.txt", "images/000003.jpg", "cameras/down/times.txt",
                           "cameras/down/images/000003.jpg"})
    EXPECT_TRUE(file_text(rig / file) == file_text(folder_ / "again" / file)) << file;
  const dataset::Rig before = dataset::read_rig(rig), after = dataset::read_rig(folder_ / "again");
  ASSERT_EQ(after.cameras.size(), 2U);
  for (std::size_t c = 0; c < 2; ++c) {
    EXPECT_EQ(after.cameras[c].name, before.cameras[c].name);
    EXPECT_LT((after.cameras[c].dataset.calibration.T_cam_imu.matrix() -
               before.cameras[c].dataset.calibration.T_cam_imu.matrix())
                  .norm(),
              1e-12);
    EXPECT_LT((after.cameras[c].T_body_camera.matrix() - before.cameras[c].T_body_camera.matrix()).norm(), 1e-12);
    const auto &a = after.cameras[c].dataset.groundtruth->poses, &b = before.cameras[c].dataset.groundtruth->poses;
    ASSERT_EQ(c == 0 ? a.size() : 4U, b.size());
    for (const geometry::StampedPose& pose : b) {
      const auto again = geometry::interpolate(*after.cameras[c].dataset.groundtruth, pose.time_s);
      ASSERT_TRUE(again.has_value());
      EXPECT_LT((again->matrix() - pose.T_local_camera.matrix()).norm(), 1e-6);
    }
  }
  EXPECT_THAT(ingest({"left=" + rig.string(), "up=" + rig.string()}).err,
              HasSubstr("camchain.yaml: has the cameras left, down, none is called up"));
  EXPECT_THAT(ingest({rig.string(), rig.string(), rig.string()}).err, HasSubstr("say which is which: NAME=PATH"));
  EXPECT_THAT(ingest({"left=" + rig.string(), rig.string()}).err, HasSubstr("give all cameras a name"));
}

TEST_F(RenderedRig, IsReadAsOneOrAsAllOfItsCameras) {
  render("rig", "rig", with("degrade.yaml"));
  const fs::path rig_folder = folder_ / "rig";
  EXPECT_THAT(dataset::rig_camera_names(rig_folder), ElementsAre("left", "right", "down"));
  const dataset::Rig rig = dataset::read_rig(rig_folder);
  ASSERT_EQ(rig.cameras.size(), 3U);
  const auto& left = rig.cameras[0].dataset;
  const auto& right = rig.cameras[1].dataset;
  EXPECT_EQ(left.frames.size(), dataset::read_dataset(rig_folder).frames.size()) << "the first is that of the folder";
  EXPECT_EQ(dataset::read_dataset(rig_folder, {.calibration = "right", .camera_id = {}}).folder, right.folder);
  EXPECT_EQ(right.imu, left.imu) << "the body's";
  ASSERT_EQ(left.groundtruth->size(), 7U);
  for (std::size_t i = 0; i < 7; ++i) {
    EXPECT_EQ(left.frames[i].time_s, right.frames[i].time_s) << "skew 0";
    const SE3 expected = left.groundtruth->poses[i].T_local_camera * rig.cameras[0].T_body_camera.inverse() *
                         rig.cameras[1].T_body_camera;
    EXPECT_LT((expected.matrix() - right.groundtruth->poses[i].T_local_camera.matrix()).cwiseAbs().maxCoeff(), 1e-9);
  }
  const SE3 T_body_imu = rig.cameras[0].T_body_camera * left.calibration.T_cam_imu;
  EXPECT_TRUE(
      (rig.cameras[1].T_body_camera * right.calibration.T_cam_imu).matrix().isApprox(T_body_imu.matrix(), 1e-9));
  const std::vector<dataset::RigInstant> instants = dataset::rig_instants(rig);
  ASSERT_EQ(instants.size(), 7U);
  EXPECT_THAT(instants[2].frames, ElementsAre(2U, 2U, 1U));
  EXPECT_THAT(instants[3].frames, ElementsAre(3U, 3U, std::nullopt));
}

/// Two cameras in one place whose clocks differ: pictures of one true instant show the same drops and the same car.
TEST_F(RenderedRig, DropsAndActorsGoByTheFlightsClock) {
  const std::string camera = TinyPlace::kCamera;
  const std::string where = "  T_cn_cnm1: [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]\n";
  std::string second = camera;
  second.replace(second.find("cam0"), 4, "cam1");
  TinyPlace::write_file(folder_ / "chain.yaml", camera + second + where + "  timeshift_cam_imu: 0.125\n");
  TinyPlace::write_file(
      folder_ / "wet.yaml",
      std::string("cameras: chain.yaml\n") + kPath +
          "weather: {rain_mm_per_h: 60}\nactors:\n  - {name: taxi, model: car, speed_m_s: 12, path: [{at: [-8, 0]}, "
          "{at: [20, 4]}]}\n");
  const ProgramResult result =
      run_tileflight({"render", (folder_ / "place").string(), "--flight", (folder_ / "wet.yaml").string(), "--out",
                      (folder_ / "wet").string(), "--png"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const dataset::Rig rig = dataset::read_rig(folder_ / "wet");
  const auto& first = rig.cameras[0].dataset.frames;
  const auto& other = rig.cameras[1].dataset.frames;
  ASSERT_EQ(first.size(), other.size());
  std::size_t changed = 0;
  for (std::size_t i = 0; i < first.size(); ++i) {
    EXPECT_NEAR(first[i].time_s - other[i].time_s, 0.125, 1e-12);
    const imaging::RgbImage a = imaging::read_rgb(first[i].image), b = imaging::read_rgb(other[i].image);
    int largest = 0;
    for (std::size_t p = 0; p < a.pixels.size(); ++p)
      for (std::size_t c = 0; c < 3; ++c) largest = std::max(largest, std::abs(a.pixels[p][c] - b.pixels[p][c]));
    EXPECT_LE(largest, 1) << "picture " << i;
    if (i > 0 && a.pixels != imaging::read_rgb(first[i - 1].image).pixels) ++changed;
  }
  EXPECT_EQ(changed, first.size() - 1);
}

/// A pixel's point by the left depth, seen by the right camera, has the depth that the right one measured there.
TEST_F(RenderedRig, DepthsOfAPairAgree) {
  render("rig", "rig", with("degrade.yaml"));
  const dataset::Rig rig = dataset::read_rig(folder_ / "rig");
  const auto& left = rig.cameras[0];
  const auto& right = rig.cameras[1];
  const SE3 T_right_left = right.T_body_camera.inverse() * left.T_body_camera;
  const auto depth_left = *dataset::read_depth(left.dataset, left.dataset.frames[3]);
  const auto depth_right = *dataset::read_depth(right.dataset, right.dataset.frames[3]);
  int seen = 0, agree = 0;
  for (int y = 4; y < depth_left.height; y += 8) {
    for (int x = 4; x < depth_left.width; x += 8) {
      const auto ray = left.dataset.calibration.camera.unproject(Vec2(x, y));
      if (!ray || !std::isfinite(depth_left(x, y))) continue;
      const Vec3 point = T_right_left * (*ray / ray->z() * static_cast<double>(depth_left(x, y)));
      const auto pixel = right.dataset.calibration.camera.project(point);
      if (!pixel) continue;
      const int u = static_cast<int>(std::lround(pixel->x())), v = static_cast<int>(std::lround(pixel->y()));
      if (u < 0 || v < 0 || u >= depth_right.width || v >= depth_right.height || !std::isfinite(depth_right(u, v)))
        continue;
      ++seen;
      agree += std::abs(depth_right(u, v) - point.z()) < 0.03 * point.z() ? 1 : 0;
    }
  }
  EXPECT_GT(seen, 300);
  EXPECT_GT(agree, 0.95 * seen);
}

TEST_F(RenderedRig, TasksAndPartsGiveTheSame) {
  render("rig", "one", {"--degrade", (folder_ / "noisy.yaml").string()});
  const std::vector<std::string> noisy{"--degrade", (folder_ / "noisy.yaml").string()};
  for (const char* part : {"0:5", "5:18"}) {
    std::vector<std::string> words = noisy;
    words.insert(words.end(), {"--frames", part});
    const ProgramResult result = run_tileflight(call("rig", "parts", words));
    ASSERT_EQ(result.exit_code, 0) << result.err;
  }
  std::vector<std::string> words = noisy;
  words.emplace_back("--resume");
  EXPECT_EQ(render("rig", "parts", words)["frames_taken_up"], 18);
  tests::expect_same_files(folder_ / "one", folder_ / "parts");
}

TEST_F(RenderedRig, IsFilmedAndTrackedByTheCameraAskedFor) {
  TinyPlace::write_file(folder_ / "video.yaml", "video_crf: 20\n");
  render("rig", "film", {"--degrade", (folder_ / "video.yaml").string()});
  for (const char* video : {"film/video.mp4", "film/cameras/right/video.mp4", "film/cameras/down/video.mp4"})
    EXPECT_TRUE(fs::is_regular_file(folder_ / video)) << video;
  const dataset::Rig rig = dataset::read_rig(folder_ / "film");
  EXPECT_EQ(rig.cameras[0].dataset.frames[0].time_s, 0.0);
  EXPECT_EQ(rig.cameras[1].dataset.frames[3].time_s, rig.cameras[0].dataset.frames[3].time_s);
  const ProgramResult wrong = run_tileflight({"export", (folder_ / "film").string(), "--layout", "tum-mono", "--camera",
                                              "middle", "--out", (folder_ / "out").string()});
  EXPECT_EQ(wrong.exit_code, 1);
  EXPECT_EQ(tests::line_count(wrong.err), 1) << wrong.err;
  EXPECT_THAT(wrong.err, HasSubstr("has no camera middle, only left, right, down"));
  const ProgramResult chosen = run_tileflight({"export", (folder_ / "film").string(), "--layout", "tum-mono",
                                               "--camera", "down", "--out", (folder_ / "out").string(), "--json"});
  ASSERT_EQ(chosen.exit_code, 0) << chosen.err;
  EXPECT_EQ(json::parse(chosen.out)["frames"], 4);
}

/// Over a city of many tiles, in as many parts as memory asks for.
TEST_F(RenderedRig, LittleMemoryChangesNothing) {
  tests::TinyCity::write(folder_ / "place");
  TinyPlace::write_file(folder_ / "pair.yaml", R"(cameras:
  - {name: left, camera: camera.yaml, resolution: [64, 48]}
  - {name: right, camera: camera.yaml, resolution: [64, 48], position: [0.5, 0.1, 0], yaw_deg: 40}
fps: 1
speed_m_s: 40
acceleration_m_s2: 40
waypoints:
  - {position: [-450, -180, 150], yaw_deg: 90, pitch_deg: -40}
  - {position: [450, -80, 150], yaw_deg: 90, pitch_deg: -40}
)");
  const json all = render("pair", "all");
  const json little = render("pair", "little", {"--memory", "0.0036"});
  EXPECT_GT(little["parts"], 2 * all["parts"].get<int>()) << little;
  tests::expect_same_files(folder_ / "all", folder_ / "little");
}

}  // namespace
}  // namespace tileflight::rig_test
