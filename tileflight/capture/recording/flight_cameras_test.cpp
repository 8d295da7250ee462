// The cameras of a flight file: a list, a Kalibr camchain, and what is wrong with them; and when they take images.
#include "tileflight/capture/recording/flight_cameras.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/refusal.h"
#include "tests/temporary_folder.h"
#include "tileflight/capture/recording/planned_flight.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/imaging/calibration_files.h"

namespace tileflight::recording::flight_cameras_test {
namespace {

using geometry::SE3;
using geometry::Vec3;
using testing::HasSubstr;

constexpr const char* kCamera = R"(cam0:
  camera_model: pinhole
  intrinsics: [152.0, 152.0, 159.5, 119.5]
  distortion_model: equidistant
  distortion_coeffs: [0.0, 0.0, 0.0, 0.0]
  resolution: [320, 240]
)";

class FlightCameras : public testing::Test {
 protected:
  FlightCameras() { base::write_file(folder_ / "camera.yaml", kCamera); }

  RenderSettings settings_with(const std::string& cameras, const std::string& more = "") const {
    base::write_file(folder_ / "flight.yaml", cameras + more +
                                                  "fps: 10\nwaypoints:\n  - {position: [0, 0, 50], yaw_deg: 30}\n"
                                                  "  - {position: [20, 0, 50], yaw_deg: 80, pitch_deg: -40}\n");
    RenderSettings settings;
    settings.flight.flight = folder_ / "flight.yaml";
    return settings;
  }
  std::vector<MountedCamera> read(const std::string& cameras) const {
    return read_flight_cameras(settings_with(cameras).flight);
  }
  PlannedFlight plan(const std::string& cameras, const std::string& more = "") const {
    return plan_flight(settings_with(cameras, more), {});
  }
  std::string refusal(const std::string& cameras) const {
    return tests::refusal_of([&] { plan(cameras); });
  }

  tests::TemporaryFolder folder_;
};

constexpr const char* kStereo = R"(cameras:
  - {name: left, camera: camera.yaml}
  - {name: right, camera: camera.yaml, position: [0.2, 0, 0], yaw_deg: 90, pitch_deg: -30, roll_deg: 20}
)";

TEST_F(FlightCameras, AnglesAreThoseOfAWaypointFromTheBodysView) {
  const std::vector<MountedCamera> cameras = read(kStereo);
  ASSERT_EQ(cameras.size(), 2U);
  EXPECT_EQ(cameras[0].name, "left");
  EXPECT_TRUE(cameras[0].T_body_camera.matrix().isIdentity(0.0));
  const SE3& T = cameras[1].T_body_camera;
  EXPECT_EQ(T.translation, Vec3(0.2, 0, 0));
  // 90 degrees to the right, 30 degrees down: x right, y down, z forward.
  EXPECT_LT((T.rotation * Vec3::UnitZ() - Vec3(std::cos(M_PI / 6), 0.5, 0)).norm(), 1e-12);
  EXPECT_GT((T.rotation * Vec3::UnitX()).y(), 0.1) << "rolled: the right side is down";
}

TEST_F(FlightCameras, EachPoseIsTheBodysTimesTheExtrinsics) {
  const PlannedFlight flight = plan(kStereo);
  ASSERT_EQ(flight.camera_count(), 2U);
  const PlannedCamera& right = flight.camera(1);
  ASSERT_EQ(right.frames.size(), flight.body.size());
  double largest = 0.0;
  for (std::size_t i = 0; i < right.frames.size(); ++i) {
    const geometry::Mat4 expected =
        flight.body.poses[i].T_local_camera.matrix() * read(kStereo)[1].T_body_camera.matrix();
    largest = std::max(largest, (right.frames.poses[i].T_local_camera.matrix() - expected).cwiseAbs().maxCoeff());
    EXPECT_EQ(right.frames.poses[i].time_s, flight.frames.poses[i].time_s) << "the same instant";
    const double between_s = right.frames.poses[i].time_s + 0.01;
    const geometry::Mat4 later = flight.pose_at(between_s).matrix() * right.T_body_camera.matrix();
    EXPECT_LT((right.pose_at(between_s).matrix() - later).cwiseAbs().maxCoeff(), 1e-9);
  }
  EXPECT_LT(largest, 1e-9);
}

TEST_F(FlightCameras, ACameraAloneInARigFliesAsTheCameraOfAFlight) {
  const PlannedFlight one = plan("cameras: [{name: only, camera: camera.yaml}]\n");
  const PlannedFlight plain = plan("camera: camera.yaml\n");
  ASSERT_EQ(one.frames.size(), plain.frames.size());
  for (std::size_t i = 0; i < one.frames.size(); ++i) {
    EXPECT_EQ(one.frames.poses[i].time_s, plain.frames.poses[i].time_s);
    EXPECT_EQ(one.frames.poses[i].T_local_camera.translation, plain.frames.poses[i].T_local_camera.translation);
    EXPECT_EQ(one.frames.poses[i].T_local_camera.rotation.coeffs(),
              plain.frames.poses[i].T_local_camera.rotation.coeffs());
  }
}

TEST_F(FlightCameras, ASlowerCameraTakesItsImagesFromTheSameStart) {
  const PlannedFlight flight = plan(
      "cameras:\n  - {name: fast, camera: camera.yaml}\n  - {name: slow, camera: camera.yaml, fps: 2.5}\n"
      "  - {name: late, camera: camera.yaml, offset_s: 0.03}\n");
  const auto& fast = flight.camera(0).frames.poses;
  const auto& slow = flight.camera(1).frames.poses;
  const auto& late = flight.camera(2).frames.poses;
  ASSERT_GT(slow.size(), 3U);
  EXPECT_EQ(slow.size(), (fast.size() + 3) / 4);
  for (std::size_t i = 0; i < slow.size(); ++i) EXPECT_EQ(slow[i].time_s, fast[4 * i].time_s);
  for (std::size_t i = 0; i < late.size(); ++i) EXPECT_NEAR(late[i].time_s, fast[i].time_s + 0.03, 1e-12);
  EXPECT_GE(late.size() + 1, fast.size()) << "one may lie beyond the path";

  const ImageOrder order(flight);
  ASSERT_EQ(order.count(), flight.image_count());
  double before_s = -1.0;
  for (std::size_t i = 0; i < order.count(); ++i) {
    const double time_s = flight.camera(order[i].camera).frames.poses[order[i].frame].time_s;
    EXPECT_GE(time_s, before_s);
    before_s = time_s;
    EXPECT_EQ(order.number_of(order[i].camera, order[i].frame), i);
  }
  EXPECT_EQ(order[1].camera, 1U) << "of one instant in the order of the cameras";
  EXPECT_EQ(order.frames_between(1, 0, 1), (jobs::IndexRange{0, 0}));
  EXPECT_EQ(order.frames_between(1, 0, 2), (jobs::IndexRange{0, 1}));
  EXPECT_EQ(order.frames_between(0, 1, order.count()), (jobs::IndexRange{1, fast.size()}));
}

TEST_F(FlightCameras, OfAKalibrChainTheFirstIsTheBody) {
  std::vector<imaging::ChainCamera> chain(2);
  chain[0].calibration = chain[1].calibration = imaging::read_calibration(folder_ / "camera.yaml");
  const SE3 T_cam_imu(geometry::so3_exp(Vec3(0.1, 0.2, 0.3)), Vec3(0.01, 0.02, 0.03));
  chain[0].calibration.T_cam_imu = T_cam_imu;
  chain[0].calibration.assumes_T_cam_imu = chain[1].calibration.assumes_T_cam_imu = false;
  chain[1].T_body_cam = SE3(geometry::so3_exp(Vec3(0, 0.05, 0)), Vec3(0.11, 0, 0.01));
  chain[1].calibration.T_cam_imu = chain[1].T_body_cam.inverse() * T_cam_imu;
  chain[0].timeshift_cam_imu_s = chain[1].timeshift_cam_imu_s = 0.02;
  imaging::write_camchain(folder_ / "camchain.yaml", chain);
  const PlannedFlight flight = plan("cameras: camchain.yaml\n");
  ASSERT_EQ(flight.camera_count(), 2U);
  EXPECT_EQ(flight.camera(1).name, "cam1");
  EXPECT_LT((flight.camera(1).T_body_camera.matrix() - chain[1].T_body_cam.matrix()).cwiseAbs().maxCoeff(), 1e-9);
  EXPECT_LT(
      (flight.camera(1).calibration.T_cam_imu.matrix() - chain[1].calibration.T_cam_imu.matrix()).cwiseAbs().maxCoeff(),
      1e-9);
  // t_imu = t_cam + shift: an image is stamped 20 ms before the instant that it shows.
  const auto& first = flight.frames.poses;
  EXPECT_NEAR(first[5].time_s, flight.body.poses[5].time_s - 0.02, 1e-12);
  EXPECT_EQ(first[5].T_local_camera.translation, flight.body.poses[5].T_local_camera.translation);
  EXPECT_LT((flight.pose_at(first[5].time_s).translation - first[5].T_local_camera.translation).norm(), 1e-9);
}

TEST_F(FlightCameras, EachHasItsOwnDegradationsOverThoseOfTheRender) {
  RenderSettings settings = settings_with(
      "cameras:\n  - {name: a, camera: camera.yaml, degrade: {vignetting: 0.4}}\n  - {name: b, camera: camera.yaml}\n");
  settings.flight.degrade = render::ImageFormation{.exposure_time_s = 0.004, .line_delay_s = 1e-5};
  const PlannedFlight flight = plan_flight(settings, {});
  EXPECT_EQ(flight.options.formation.vignetting, 0.4);
  EXPECT_EQ(flight.options.formation.exposure_time_s, 0.004);
  EXPECT_EQ(flight.camera(1).options.formation.vignetting, 0.0);
  EXPECT_EQ(flight.camera(1).calibration.line_delay_s, 1e-5);
  EXPECT_NE(flight.camera(1).options.formation.seed, flight.options.formation.seed) << "noise of its own";
}

TEST_F(FlightCameras, WhatIsWrongIsSaidInOneLine) {
  const auto entry = [](const std::string& keys) {
    return "cameras:\n  - {name: a, camera: camera.yaml" + keys + "}\n";
  };
  EXPECT_THAT(refusal("cameras: []\n"), HasSubstr("'cameras' lists no camera; give at least one"));
  EXPECT_THAT(refusal("camera: camera.yaml\n" + entry("")), HasSubstr("'camera' are both given"));
  EXPECT_THAT(refusal(entry("") + "  - {name: A, camera: camera.yaml}\n"),
              HasSubstr("flight.yaml: two cameras are called 'A'"));
  EXPECT_THAT(refusal("cameras: [{name: a}]\n"), HasSubstr("is missing; name the calibration file"));
  EXPECT_THAT(refusal("cameras: [{camera: camera.yaml}]\n"), HasSubstr("'cameras[0].name' is required"));
  EXPECT_THAT(refusal("cameras: [{name: ../a, camera: camera.yaml}]\n"),
              HasSubstr("'cameras[0].name' a camera's name is that of a folder"));
  for (const char* frame : {"map", "odom", "base_link", "Base-Link", "imu", "lidar"})
    EXPECT_THAT(refusal("cameras: [{name: " + std::string(frame) + ", camera: camera.yaml}]\n"),
                HasSubstr("no camera can be called '" + std::string(frame) + "': that frame is another one"));
  EXPECT_THAT(refusal("cameras: [{name: a-b, camera: camera.yaml}, {name: a_b, camera: camera.yaml}]\n"),
              HasSubstr("two cameras are called 'a_b'"))
      << "their topics would be one";
  EXPECT_THAT(refusal("cameras: [3]\n"), HasSubstr("must be a map of keys"));
  EXPECT_THAT(refusal("cameras: none.yaml\n"), HasSubstr("none.yaml"));
  EXPECT_THAT(refusal(entry(", fsp: 3")),
              HasSubstr("'cameras[0].fsp' is not a key here; there are T_body_camera, camera"));
  EXPECT_THAT(refusal(entry(", fps: 1e9")), HasSubstr("more than ten million images; lower 'fps'"));
  EXPECT_THAT(refusal(entry(", offset_s: 40000000")), HasSubstr("out of range: from -10 to 10"));
  EXPECT_THAT(refusal(entry(", offset_s: -9")), HasSubstr("camera a: takes no image during the flight"));
  EXPECT_THAT(refusal(entry(", resolution: [320, 100]")), HasSubstr("aspect ratio"));
  EXPECT_THAT(refusal(entry(", T_body_camera: [2, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]")),
              HasSubstr("is not a rigid motion"));
  EXPECT_THAT(refusal(entry(", position: [0, 0, 0], T_body_camera: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]")),
              HasSubstr("and position or angles are both given"));
  RenderSettings replaced = settings_with(kStereo);
  replaced.flight.camera = folder_ / "camera.yaml";
  EXPECT_THAT(tests::refusal_of([&] { plan_flight(replaced, {}); }), HasSubstr("one 'camera' only"));
}

TEST_F(FlightCameras, ARigsFileIsAChainOrAFlight) {
  settings_with(kStereo);
  const std::vector<MountedCamera> listed = read_rig_cameras(folder_ / "flight.yaml");
  ASSERT_EQ(listed.size(), 2U);
  imaging::write_camchain(folder_ / "chain.yaml",
                          {{"left", ".", listed[0].calibration, listed[0].T_body_camera, 0.0},
                           {"right", "cameras/right", listed[1].calibration, listed[1].T_body_camera, 0.004}});
  base::write_file(folder_ / "named.yaml", "cameras: chain.yaml\n");
  for (const char* file : {"chain.yaml", "named.yaml"}) {
    const std::vector<MountedCamera> chained = read_rig_cameras(folder_ / file);
    ASSERT_EQ(chained.size(), 2U) << file;
    EXPECT_EQ(chained[1].name, "right");
    EXPECT_EQ(chained[1].timeshift_s, 0.004);
    EXPECT_TRUE(chained[1].T_body_camera.matrix().isApprox(listed[1].T_body_camera.matrix(), 1e-12));
  }
  base::write_file(folder_ / "empty.yaml", "cameras: []\n");
  EXPECT_THAT(tests::refusal_of([&] { read_rig_cameras(folder_ / "empty.yaml"); }), HasSubstr("lists no camera"));
  EXPECT_THAT(tests::refusal_of([&] { read_rig_cameras(folder_ / "none.yaml"); }), HasSubstr("none.yaml"));
  base::write_file(folder_ / "other.yaml", "fps: 3\n");
  EXPECT_THAT(tests::refusal_of([&] { read_rig_cameras(folder_ / "other.yaml"); }), HasSubstr("not a Kalibr camchain"));
}

TEST_F(FlightCameras, ThousandCamerasAreAFlightOrTooManyImages) {
  std::string cameras = "cameras:\n";
  for (int i = 0; i < 1000; ++i) cameras += "  - {name: c" + std::to_string(i) + ", camera: camera.yaml, fps: 1}\n";
  EXPECT_EQ(plan(cameras).camera_count(), 1000U);
  std::string many = "cameras:\n";
  for (int i = 0; i < 1000; ++i) many += "  - {name: c" + std::to_string(i) + ", camera: camera.yaml, fps: 4000}\n";
  EXPECT_THAT(refusal(many), HasSubstr("take more than ten million images"));
}

}  // namespace
}  // namespace tileflight::recording::flight_cameras_test
