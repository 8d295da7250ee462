// Rigs on disk: written by export in the layouts of others, read again, and what is wrong with them.
#include "tileflight/data/dataset/rig.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "tests/refusal.h"
#include "tests/temporary_folder.h"
#include "tests/test_data.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/imaging/calibration_files.h"
#include "tileflight/data/exports/export_dataset.h"
#include "tileflight/data/messages/dataset_messages.h"

namespace tileflight::exports::rig_test {
namespace {

namespace fs = std::filesystem;
using geometry::SE3;
using geometry::Vec3;
using testing::ElementsAre;
using testing::HasSubstr;
using tests::refusal_of;

constexpr int kFrames = 4;
constexpr double kBaseline_m = 0.25;

SE3 body_pose(int i) { return {geometry::so3_exp(Vec3(0.1 * i, 0.2, -0.05 * i)), Vec3(i, 2.0 * i, 30.0)}; }

/// As `render` writes it: `left`, and in cameras/right `right` of this pose, whose times are later by `late_s`.
class RigTest : public testing::Test {
 protected:
  void write(const SE3& T_left_right, double late_s = 0.0, double timeshift_s = 0.0) const {
    imaging::Calibration calibration;
    calibration.camera = imaging::Camera(imaging::PinholeRadtan{50, 50, 31.5, 23.5, {}}, 64, 48);
    calibration.T_cam_imu = SE3(geometry::so3_exp(Vec3(0, 0.3, 0)), Vec3(0.01, 0.02, 0.03));
    imaging::Calibration of_right = calibration;
    of_right.T_cam_imu = T_left_right.inverse() * calibration.T_cam_imu;
    write_camera(folder_ / "rig", calibration, {}, -timeshift_s);
    fs::create_directories(folder_ / "rig/cameras");
    write_camera(folder_ / "rig/cameras/right", of_right, T_left_right, late_s - timeshift_s);
    imaging::write_camchain(
        folder_ / "rig/camchain.yaml",
        {{"left", ".", calibration, {}, timeshift_s}, {"right", "cameras/right", of_right, T_left_right, timeshift_s}});
  }
  static void write_camera(const fs::path& folder, const imaging::Calibration& calibration, const SE3& T_body_camera,
                           double late_s) {
    dataset::DatasetWriter writer(folder, calibration, {.png = true});
    geometry::Trajectory poses;
    for (int i = 0; i < kFrames; ++i) {
      imaging::RgbImage image(64, 48);
      for (auto& pixel : image.pixels) pixel = {static_cast<std::uint8_t>(40 * i), 9, 200};
      writer.add_frame(i, 1.0 + 0.1 * i + late_s, 0.0, image);
      poses.poses.push_back({1.0 + 0.1 * i + late_s, body_pose(i) * T_body_camera});
    }
    writer.set_groundtruth(poses);
    writer.finish();
  }
  void exported(const std::string& layout) const {
    export_rig(dataset::read_rig(folder_ / "rig"), layout, folder_ / layout, false);
  }

  tests::TemporaryFolder folder_;
};

const SE3 kBeside({Eigen::Quaterniond::Identity(), Vec3(kBaseline_m, 0, 0)});
const SE3 kTurned({geometry::so3_exp(Vec3(0.02, 0.4, -0.1)), Vec3(0.2, 0.05, 0.1)});

void expect_near(const SE3& a, const SE3& b) {
  EXPECT_LT((a.matrix() - b.matrix()).cwiseAbs().maxCoeff(), 1e-9) << a.matrix() << "\n\n" << b.matrix();
}

TEST_F(RigTest, EurocHasAllCamerasWithTheirMounts) {
  write(kTurned);
  exported("euroc");
  EXPECT_THAT(dataset::rig_camera_names(folder_ / "euroc"), ElementsAre("cam0", "cam1"));
  const dataset::Rig rig = dataset::read_rig(folder_ / "euroc");
  ASSERT_EQ(rig.cameras.size(), 2U);
  expect_near(rig.cameras[0].T_body_camera.inverse() * rig.cameras[1].T_body_camera, kTurned);
  for (int i = 0; i < kFrames; ++i) {
    EXPECT_EQ(rig.cameras[0].dataset.frames[i].time_s, rig.cameras[1].dataset.frames[i].time_s);
    expect_near(rig.cameras[1].dataset.groundtruth->poses[i].T_local_camera, body_pose(i) * kTurned);
  }
  EXPECT_EQ(dataset::read_dataset(folder_ / "euroc").frames[0].image.parent_path().parent_path().filename(), "cam0");
  EXPECT_EQ(dataset::read_dataset(folder_ / "euroc", {.calibration = "cam1", .camera_id = {}})
                .frames[0]
                .image.parent_path()
                .parent_path()
                .filename(),
            "cam1");
}

TEST_F(RigTest, KittiHasARectifiedPair) {
  write(kBeside);
  exported("kitti");
  EXPECT_THAT(dataset::rig_camera_names(folder_ / "kitti"), ElementsAre("image_0", "image_1"));
  const dataset::Rig rig = dataset::read_rig(folder_ / "kitti");
  expect_near(rig.cameras[1].T_body_camera, kBeside);
  // KITTI's poses are relative to the first image.
  expect_near(rig.cameras[1].dataset.groundtruth->poses[2].T_local_camera,
              body_pose(0).inverse() * body_pose(2) * kBeside);
}

TEST_F(RigTest, KittiRefusesWhatIsNotRectifiedOrNotOfOneInstant) {
  write(kTurned);
  EXPECT_THAT(refusal_of([&] { exported("kitti"); }), HasSubstr("KITTI's pairs are rectified, but right"));
  EXPECT_FALSE(fs::exists(folder_ / "kitti"));
}

TEST_F(RigTest, KittiRefusesTimesOfTheirOwn) {
  write(kBeside, 0.02);
  EXPECT_THAT(refusal_of([&] { exported("kitti"); }), HasSubstr("KITTI's pairs are of one instant"));
}

TEST_F(RigTest, ColmapHasARigAndItsFrames) {
  write(kTurned);
  exported("colmap");
  const fs::path model = folder_ / "colmap/sparse/0";
  EXPECT_TRUE(fs::is_regular_file(folder_ / "colmap/images/right/000003.png"));
  EXPECT_THAT(base::read_text(model / "rigs.txt"), HasSubstr("\n1 2 CAMERA 1 CAMERA 2 1 "));
  EXPECT_THAT(base::read_text(model / "images.txt"), HasSubstr(" 2 right/000003.png\n"));
  // Every image's pose is that of its frame, times the rig's: world to rig, rig to sensor.
  std::ifstream rigs(model / "rigs.txt"), frames(model / "frames.txt");
  std::string line, word;
  std::getline(rigs, line);
  double q[4], t[3];
  for (int i = 0; i < 7; ++i) rigs >> word;
  rigs >> q[0] >> q[1] >> q[2] >> q[3] >> t[0] >> t[1] >> t[2];
  const SE3 T_right_rig(Eigen::Quaterniond(q[0], q[1], q[2], q[3]), Vec3(t));
  expect_near(T_right_rig, kTurned.inverse());
  std::getline(frames, line);
  for (int i = 0; i < kFrames; ++i) {
    int id = 0, rig = 0, count = 0, sensor = 0, first = 0, second = 0;
    frames >> id >> rig >> q[0] >> q[1] >> q[2] >> q[3] >> t[0] >> t[1] >> t[2] >> count >> word >> sensor >> first >>
        word >> sensor >> second;
    EXPECT_EQ(count, 2);
    EXPECT_EQ(second, first + 1);
    expect_near(SE3(Eigen::Quaterniond(q[0], q[1], q[2], q[3]), Vec3(t)), body_pose(i).inverse());
  }
}

TEST_F(RigTest, VslamLabHasThePairBesideEachOther) {
  write(kTurned);
  exported("vslamlab");
  const std::string list = base::read_text(folder_ / "vslamlab/rgb.csv");
  EXPECT_THAT(list, HasSubstr("ts_rgb_0 (ns),path_rgb_0,ts_rgb_1 (ns),path_rgb_1\n"));
  EXPECT_THAT(list, HasSubstr("\n1100000000,rgb_0/000001.png,1100000000,rgb_1/000001.png\n"));
  const imaging::VslamLabCamera right = imaging::read_vslam_lab_camera(folder_ / "vslamlab/calibration.yaml", "rgb_1");
  expect_near(right.T_body_cam, kTurned);
  EXPECT_EQ(dataset::read_dataset(folder_ / "vslamlab").frames.size(), 4U) << "the first camera is read";
}

TEST_F(RigTest, VslamLabHasAllCamerasWithTheirMounts) {
  write(kTurned, 0.0, 0.025);
  exported("vslamlab");
  const fs::path folder = folder_ / "vslamlab";
  EXPECT_THAT(dataset::rig_camera_names(folder), ElementsAre("rgb_0", "rgb_1"));
  const dataset::Rig rig = dataset::read_rig(folder);
  ASSERT_EQ(rig.cameras.size(), 2U);
  expect_near(rig.cameras[0].T_body_camera.inverse() * rig.cameras[1].T_body_camera, kTurned);
  EXPECT_EQ(dataset::rig_instants(rig).size(), std::size_t{kFrames});
  for (int i = 0; i < kFrames; ++i) {
    EXPECT_EQ(rig.cameras[1].dataset.frames[i].image.parent_path().filename(), "rgb_1");
    expect_near(rig.cameras[1].dataset.groundtruth->poses[i].T_local_camera, body_pose(i) * kTurned);
  }
  EXPECT_EQ(dataset::read_dataset(folder, {.calibration = "rgb_1", .camera_id = {}}).frames[2].image.filename(),
            "000002.png");
  EXPECT_THAT(refusal_of([&] { dataset::read_dataset(folder, {.calibration = "rgb_2", .camera_id = {}}); }),
              HasSubstr("has no camera rgb_2, only rgb_0, rgb_1"));
}

TEST_F(RigTest, VslamLabMayHaveFewerPicturesOfAnotherCamera) {
  write(kTurned);
  exported("vslamlab");
  const fs::path folder = folder_ / "vslamlab";
  std::string list = base::read_text(folder / "rgb.csv");
  const std::string second = ",1100000000,rgb_1/000001.png";
  ASSERT_NE(list.find(second), std::string::npos);
  list.replace(list.find(second), second.size(), ",,");
  base::write_file(folder / "rgb.csv", list);
  const std::vector<dataset::RigInstant> instants = dataset::rig_instants(dataset::read_rig(folder));
  ASSERT_EQ(instants.size(), std::size_t{kFrames});
  EXPECT_THAT(instants[1].frames, ElementsAre(1U, std::nullopt));
  std::string calibration = base::read_text(folder / "calibration.yaml");
  calibration.replace(calibration.find("rgb_1"), 5, "rgb_7");
  base::write_file(folder / "calibration.yaml", calibration);
  EXPECT_THAT(refusal_of([&] { dataset::read_rig(folder); }), HasSubstr("rgb_1"));
}

TEST_F(RigTest, MessagesAreOfEachCameraByItsName) {
  write(kTurned);
  const dataset::Rig rig = dataset::read_rig(folder_ / "rig");
  const messages::DatasetMessages listed = messages::list_messages(rig);
  std::vector<std::string> topics;
  for (const messages::MessageTopic& topic : listed.topics) topics.push_back(topic.name);
  EXPECT_THAT(topics, ElementsAre("/left/image/compressed", "/left/camera_info", "/right/image/compressed",
                                  "/right/camera_info", "/tf_static", "/tf"));
  std::vector<int> images_at(kFrames);
  for (const messages::DatasetMessage& message : listed.messages) {
    if (message.topic == 0 || message.topic == 2) ++images_at[(message.time_ns - 1'000'000'000) / 100'000'000];
    EXPECT_FALSE(message.make().empty());
  }
  EXPECT_THAT(images_at, ElementsAre(2, 2, 2, 2)) << "of the same instants, to the nanosecond";
}

TEST_F(RigTest, TimesAreBroughtToTheClockOfTheBody) {
  write(kBeside, 0.0, 0.025);
  const dataset::Rig rig = dataset::read_rig(folder_ / "rig");
  EXPECT_EQ(rig.cameras[1].timeshift_s, 0.025);
  EXPECT_NEAR(dataset::rig_instants(rig)[1].time_s, 1.1, 1e-12);
  exported("euroc");
  EXPECT_TRUE(fs::is_regular_file(folder_ / "euroc/mav0/cam1/data/1100000000.png"));
}

TEST_F(RigTest, InstantsAreOfWhatEachCameraTook) {
  write(kBeside, 0.05);
  const std::vector<dataset::RigInstant> apart = dataset::rig_instants(dataset::read_rig(folder_ / "rig"));
  ASSERT_EQ(apart.size(), 8U);
  EXPECT_THAT(apart[1].frames, ElementsAre(std::nullopt, 0U));
  EXPECT_EQ(dataset::rig_instants(dataset::read_rig(folder_ / "rig"), 0.06).size(), 4U);
}

TEST_F(RigTest, ABrokenChainIsSaidInOneLine) {
  write(kBeside);
  const fs::path file = folder_ / "rig/camchain.yaml";
  const std::string good = base::read_text(file);
  const auto broken = [&](const std::string& from, const std::string& to) {
    std::string text = good;
    text.replace(text.find(from), from.size(), to);
    base::write_file(file, text);
    return refusal_of([&] { dataset::read_rig(folder_ / "rig"); });
  };
  EXPECT_THAT(broken("folder: cameras/right", "folder: ../../etc"),
              HasSubstr("is not a file within the dataset's folder"));
  EXPECT_THAT(broken("cam1:", "cam2:"), HasSubstr("cam1"));
  EXPECT_THAT(broken("name: right", "name: base_link"), HasSubstr("no camera can be called 'base_link'"));
  EXPECT_THAT(broken("name: right", "name: ../x"), HasSubstr("a camera's name is that of a folder"));
  EXPECT_THAT(broken("folder: cameras/right", "folder: cameras/none"), HasSubstr("no such dataset folder"));
  base::write_file(file, good);
  EXPECT_THAT(refusal_of([&] { dataset::read_dataset(folder_ / "rig", {.calibration = "middle", .camera_id = {}}); }),
              HasSubstr("has no camera middle, only left, right"));
}

TEST_F(RigTest, APublishedKittiSequenceIsAPair) {
  TILEFLIGHT_REQUIRE_TEST_DATA(folder, "sequences/kitti_seq1_51frames");
  EXPECT_THAT(dataset::rig_camera_names(folder), ElementsAre("image_l", "image_r"));
  const dataset::Rig rig = dataset::read_rig(folder);
  ASSERT_EQ(rig.cameras.size(), 2U);
  EXPECT_EQ(rig.cameras[1].dataset.frames.size(), 51U);
  EXPECT_EQ(rig.cameras[1].dataset.frames[7].image.parent_path().filename(), "image_r");
  const Vec3& baseline = rig.cameras[1].T_body_camera.translation;
  EXPECT_NEAR(baseline.x(), 0.54, 0.01) << "of KITTI's grey cameras (Geiger et al., IJRR 2013, figure 3)";
  EXPECT_LT(baseline.tail<2>().norm(), 0.01);
  EXPECT_EQ(dataset::rig_instants(rig).size(), 51U);
}

TEST_F(RigTest, APublishedEurocFolderWithOneCameraIsARigOfOne) {
  TILEFLIGHT_REQUIRE_TEST_DATA(folder, "sequences/euroc_V1_01_static");
  EXPECT_TRUE(dataset::rig_camera_names(folder).empty());
  const dataset::Rig rig = dataset::read_rig(folder);
  ASSERT_EQ(rig.cameras.size(), 1U);
  EXPECT_EQ(rig.cameras.front().dataset.frames.size(), dataset::read_dataset(folder).frames.size());
}

}  // namespace
}  // namespace tileflight::exports::rig_test
