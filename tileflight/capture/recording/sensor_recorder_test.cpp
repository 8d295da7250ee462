#include "tileflight/capture/recording/sensor_recorder.h"

#include <gmock/gmock.h>

#include "tests/refusal.h"
#include "tests/temporary_folder.h"
#include "tileflight/capture/render/test_scenes.h"
#include "tileflight/core/base/files.h"
#include "tileflight/data/dataset/sensor_files.h"

namespace tileflight::recording::sensor_recorder_test {
namespace {

namespace fs = std::filesystem;
using geometry::Vec3;
using testing::HasSubstr;

/// Two seconds over flat ground, 20 m below, looking down; frames at 10 Hz from 3 s on.
geometry::Trajectory frames() {
  geometry::Trajectory trajectory;
  for (int i = 0; i <= 20; ++i)
    trajectory.poses.push_back({3.0 + 0.1 * i, render::test_scenes::looking_down(Vec3(i, 0, 20))});
  return trajectory;
}

scene::Scene ground() {
  return scene::Scene({render::test_scenes::ground(
      Vec3::Zero(), 300.0,
      render::test_scenes::texture(1, 1, [](int, int) { return render::test_scenes::grey(200); }))});
}

sensors::SensorSuite suite() {
  sensors::SensorSuite suite;
  suite.imu = sensors::ImuOptions{};
  suite.barometer = sensors::BarometerOptions{};
  suite.range_finder = sensors::RangeFinderOptions{.rate_hz = 7.0};
  suite.lidar = sensors::LidarOptions{.pattern = sensors::RasterPattern{.rate_hz = 6.0, .columns = 10, .rows = 5}};
  return suite;
}

/// The time of a frame, as the border between two parts.
double at(std::size_t frame) {
  const double ever = std::numeric_limits<double>::infinity();
  if (frame == 0) return -ever;
  return frame < frames().size() ? frames().poses[frame].time_s : ever;
}

SensorRecorder files() { return {suite(), flight_path::path_through_poses(frames()), frames()}; }

TEST(SensorRecorder, AFlightInPartsGivesTheSameFiles) {
  const tests::TemporaryFolder folder;
  const scene::Scene scene = ground();
  fs::create_directories(folder / "whole");
  fs::create_directories(folder / "parts");
  SensorRecorder whole = files(), parts = files();
  whole.record(scene, {}, at(0), at(21), folder / "whole");
  parts.record(scene, {}, at(0), at(6), folder / "parts");
  parts.record(scene, {}, at(6), at(7), folder / "parts");
  parts.record(scene, {}, at(7), at(21), folder / "parts");
  whole.write({}, 3.0, folder / "whole");
  parts.write({}, 3.0, folder / "parts");
  std::size_t compared = 0;
  for (const auto& entry : fs::recursive_directory_iterator(folder / "whole")) {
    if (!entry.is_regular_file()) continue;
    const fs::path name = fs::relative(entry.path(), folder / "whole");
    EXPECT_EQ(base::read_text(entry.path()), base::read_text(folder / "parts" / name)) << name;
    ++compared;
  }
  EXPECT_EQ(compared, 3U + 1U + 1U + 12U + 2U);  // IMU, barometer, ranges, whole scans within 2 s, their lists
  EXPECT_EQ(whole.description().at("sensors.lidar.scans"), "12");
}

TEST(SensorRecorder, TimesAreTheDatasetsClock) {
  const tests::TemporaryFolder folder;
  SensorRecorder sensors = files();
  sensors.record(ground(), {}, at(0), at(21), folder / ".");
  sensors.write({}, 0.0, folder / ".");  // a video's clock begins with its first picture
  EXPECT_NEAR(dataset::read_imu_csv(folder / "imu.csv").back().time_s, 2.0, 1e-9);
  EXPECT_NEAR(dataset::read_number_table(folder / "range.csv").rows.at(7)[0], 1.0, 1e-9);
  EXPECT_NEAR(geometry::read_tum(folder / "lidar/poses.txt").poses.at(3).time_s, 0.5, 1e-9);
}

TEST(SensorRecorder, OnTheEarthTheFieldAndTheHeightAreTheEarths) {
  const tests::TemporaryFolder folder;
  sensors::SensorSuite suite;
  suite.magnetometer = sensors::MagnetometerOptions{.noise_ut = 0.0};
  suite.barometer = sensors::BarometerOptions{.noise_pa = 0.0, .drift_pa = 0.0};
  SensorRecorder sensors(suite, flight_path::path_through_poses(frames()), frames());
  EXPECT_THAT(tests::refusal_of([&] { sensors.record(ground(), {}, at(0), at(21), folder / "."); }),
              HasSubstr("the place is not georeferenced"));
  // Quito, Ecuador: 2800 m above the ellipsoid; the geoid (EGM96) lies some 26 m above it there.
  const geometry::LocalFrame quito({-0.2, -78.5, {2800.0}});
  sensors.record(ground(), quito, at(0), at(21), folder / ".");
  sensors.write(quito, 3.0, folder / ".");
  const auto field = dataset::read_number_table(folder / "magnetometer.csv").rows.at(0);
  EXPECT_NEAR(Vec3(field[1], field[2], field[3]).norm(), 29.0, 1.0);
  EXPECT_NEAR(dataset::read_number_table(folder / "barometer.csv").rows.at(0)[3], 2820.0 - 26.0, 4.0);
}

}  // namespace
}  // namespace tileflight::recording::sensor_recorder_test
