#include "tileflight/capture/ingest/telemetry_offset.h"

#include <gmock/gmock.h>

#include <cmath>
#include <random>
#include <tuple>

#include "tests/test_data.h"
#include "tileflight/capture/flight_path/path.h"

namespace tileflight::ingest::telemetry_offset_test {
namespace {

using geometry::SE3;
using geometry::so3_exp;
using geometry::Vec3;

constexpr double kOffset_s = -2.35;  ///< the camera's time minus the log's

/// A flight in the local frame with a steady or an unsteady course and an oblique camera.
struct Flown {
  bool turns = true;

  double yaw_deg(double t) const { return turns ? 40 * std::sin(0.5 * t) + 15 * std::sin(1.3 * t + 1) : 30.0; }
  double pitch_deg(double t) const { return turns ? -30 + 5 * std::sin(0.9 * t) : -30.0; }
  SE3 camera(double t) const {
    const Vec3 bend =
        turns ? Vec3(6 * std::sin(0.6 * t), 9 * std::cos(0.37 * t), 2 * std::sin(0.8 * t)) : Vec3(0, 0, 0);
    return {flight_path::camera_orientation(yaw_deg(t), pitch_deg(t), 0), Vec3(5 * t, 2 * t, 40) + bend};
  }
};

/// The odometry estimate: arbitrary frame and scale, small errors.
geometry::Trajectory tracked(const Flown& flown) {
  std::mt19937 random(3);
  std::normal_distribution<double> normal(0, 1);
  const geometry::Sim3 T_map_local(0.031, so3_exp({1, 0.5, -2}), {0.3, -0.2, 4});
  geometry::Trajectory trajectory;
  for (double t = 0; t < 25; t += 1 / 30.0) {
    SE3 pose = T_map_local * flown.camera(t);
    pose.translation += 1e-4 * Vec3(normal(random), normal(random), normal(random));
    pose.rotation = pose.rotation * so3_exp(5e-4 * Vec3(normal(random), normal(random), normal(random)));
    trajectory.poses.push_back({t, pose});
  }
  return trajectory;
}

enum class Knows { kTrack, kGimbal, kGyroscope };

flight_logs::Telemetry logged(const Flown& flown, Knows knows) {
  std::mt19937 random(5);
  std::normal_distribution<double> normal(0, 1);
  const geometry::LocalFrame frame({47.0, 8.5, {400.0}});
  flight_logs::Telemetry log;
  for (double t = 0; t < 35; t += 0.1) {
    const double camera_s = t + kOffset_s;
    const Vec3 noise(normal(random), normal(random), 1.5 * normal(random));
    const auto place = frame.geodetic_from_local(flown.camera(camera_s).translation + 0.15 * noise);
    flight_logs::TelemetryFix fix{
        .time_s = t, .latitude_deg = place.latitude_deg, .longitude_deg = place.longitude_deg};
    fix.absolute_height_m = place.height.m;
    if (knows != Knows::kTrack) {
      fix.gimbal_yaw_deg = flown.yaw_deg(camera_s);
      fix.gimbal_pitch_deg = flown.pitch_deg(camera_s);
      fix.gimbal_roll_deg = 0.0;
    }
    log.fixes.push_back(fix);
  }
  if (knows != Knows::kGyroscope) return log;
  const Eigen::Quaterniond R_body_camera = so3_exp({0.2, 1.4, -0.6});
  for (double t = -1; t < 36; t += 0.005) {
    const double h = 1e-4, camera_s = t + kOffset_s;
    const Vec3 turned =
        geometry::so3_log(flown.camera(camera_s - h).rotation.conjugate() * flown.camera(camera_s + h).rotation);
    const Vec3 noise(normal(random), normal(random), normal(random));
    log.body_rates.push_back({t, R_body_camera * turned / (2 * h) + 0.02 * noise + Vec3(0.01, -0.02, 0.005)});
  }
  return log;
}

TEST(TelemetryOffset, ByGyroscopeGimbalOrTrack) {
  const Flown flown;
  for (const auto& [knows, name, tolerance_s] :
       {std::tuple(Knows::kGyroscope, "gyroscope", 0.005), std::tuple(Knows::kGimbal, "gimbal", 0.005),
        std::tuple(Knows::kTrack, "track", 0.06)}) {
    const TelemetryOffset found = estimate_telemetry_offset(tracked(flown), logged(flown, knows));
    ASSERT_TRUE(found.offset.determined) << name << ": " << found.offset.reason;
    EXPECT_EQ(found.source, name);
    EXPECT_NEAR(found.offset.offset_s, kOffset_s, tolerance_s) << name;
    EXPECT_LT(std::abs(found.offset.offset_s - kOffset_s), 5 * found.offset.sigma_s + 0.002) << name;
    EXPECT_LT(found.offset.sigma_s, tolerance_s) << name;
  }
}

TEST(TelemetryOffset, AStraightFlightDoesNotTellIt) {
  const Flown straight{.turns = false};
  const TelemetryOffset found = estimate_telemetry_offset(tracked(straight), logged(straight, Knows::kGyroscope));
  EXPECT_FALSE(found.offset.determined) << found.source << " " << found.offset.offset_s << " "
                                        << found.offset.explained_variance << " " << found.offset.sigma_s;
  EXPECT_THAT(found.offset.reason, testing::AllOf(testing::HasSubstr("gyroscope: "), testing::HasSubstr("track: ")));
}

/// A gimbal keeps the camera's orientation while the vehicle turns: the track determines the offset, not the gyroscope.
TEST(TelemetryOffset, WhereTheGyroscopeIsOfAnotherMotionTheTrackTells) {
  const Flown flown;
  flight_logs::Telemetry log = logged(flown, Knows::kTrack);
  std::mt19937 random(8);
  std::normal_distribution<double> normal(0, 0.3);
  for (double t = 0; t < 35; t += 0.02)
    log.body_rates.push_back({t, Vec3(normal(random), normal(random), normal(random))});
  const TelemetryOffset found = estimate_telemetry_offset(tracked(flown), log);
  ASSERT_TRUE(found.offset.determined) << found.offset.reason;
  EXPECT_EQ(found.source, "track");
}

/// The flight's own subtitles against its true path: their stamps are the video's, which the gimbal's angles confirm.
TEST(RealTelemetryOffset, SubtitlesOfAVideoMovedInTime) {
  TILEFLIGHT_REQUIRE_TEST_DATA(folder, "flights/machangara-a");
  const geometry::Trajectory path = geometry::read_tum(folder / "groundtruth.txt");
  flight_logs::Telemetry log = flight_logs::read_dji_srt(folder / "telemetry.srt");
  for (flight_logs::TelemetryFix& fix : log.fixes) fix.time_s += 7.5;
  const TelemetryOffset by_gimbal = estimate_telemetry_offset(path, log);
  ASSERT_TRUE(by_gimbal.offset.determined) << by_gimbal.offset.reason;
  EXPECT_EQ(by_gimbal.source, "gimbal");
  EXPECT_NEAR(by_gimbal.offset.offset_s, -7.5, 0.03);
  for (flight_logs::TelemetryFix& fix : log.fixes) fix.gimbal_yaw_deg.reset();
  const TelemetryOffset by_track = estimate_telemetry_offset(path, log);
  RecordProperty("track_offset_s", std::to_string(by_track.offset.offset_s));
  RecordProperty("track_sigma_s", std::to_string(by_track.offset.sigma_s));
  if (by_track.offset.determined) {
    EXPECT_NEAR(by_track.offset.offset_s, -7.5, 0.5);  // the receiver lags by a fraction of a second
  }
}

}  // namespace
}  // namespace tileflight::ingest::telemetry_offset_test
