// A drone that carries more than a camera over a small place whose height is known everywhere.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "tests/run_program.h"
#include "tests/tiny_place.h"
#include "tileflight/data/dataset/dataset.h"
#include "tileflight/data/dataset/lidar_files.h"
#include "tileflight/data/dataset/sensor_files.h"

namespace tileflight::sensors_test {
namespace {

namespace fs = std::filesystem;
using geometry::Vec3;
using tests::file_text;
using tests::ProgramResult;
using tests::run_tileflight;
using tests::TinyPlace;

constexpr const char* kFlight = R"(camera: camera.yaml
fps: 4
speed_m_s: 6
max_frames: 10
waypoints:
  - {position: [-20, -10, 115], yaw_deg: 90, pitch_deg: -50}
  - {position: [0, 5, 118], yaw_deg: 60, pitch_deg: -60}
sensors:
  imu: {preset: perfect, rate_hz: 100}
  gnss: {rate_hz: 5}
  barometer: {rate_hz: 20, noise_pa: 0, drift_pa: 0, origin_above_sea_m: 2700}
  magnetometer: {declination_deg: -5, inclination_deg: 20, strength_ut: 29}
  range_finder: {rate_hz: 10, noise_m: 0, rays: 1, beam_width_deg: 0}
  lidar: {pattern: raster, columns: 40, rows: 30, horizontal_fov_deg: 60, vertical_fov_deg: 40, rate_hz: 8, range_sigma_m: 0, motion: corrected}
)";

class Sensors : public ::testing::Test {
 protected:
  Sensors() {
    TinyPlace::write(folder_ / "place");
    TinyPlace::write_file(folder_ / "camera.yaml", TinyPlace::kCamera);
    TinyPlace::write_file(folder_ / "flight.yaml", kFlight);
  }

  ProgramResult render(const std::string& out, const std::vector<std::string>& more = {}) const {
    std::vector<std::string> call{
        "render", (folder_ / "place").string(), "--flight", (folder_ / "flight.yaml").string(),
        "--out",  (folder_ / out).string(),     "--json"};
    call.insert(call.end(), more.begin(), more.end());
    return run_tileflight(call);
  }

  tests::TemporaryFolder folder_;
};

void expect_ground(const std::vector<dataset::ScanPoint>& points, const geometry::SE3& T_local_lidar) {
  for (const dataset::ScanPoint& point : points) {
    const Vec3 p = T_local_lidar * point.position.cast<double>();
    ASSERT_NEAR(p.z(), TinyPlace::height(p.x(), p.y()), 0.03);  // the place is made of flat squares of a metre
    ASSERT_GT(point.intensity, 0.0F);
  }
}

TEST_F(Sensors, AllSayWhatIsThereAtTheirTimes) {
  const ProgramResult result = render("data");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const fs::path data = folder_ / "data";
  const dataset::Dataset frames = dataset::read_dataset(data);
  const geometry::Trajectory& truth = *frames.groundtruth;
  ASSERT_EQ(truth.size(), 10U);
  const auto place_at = [&](double t) { return geometry::interpolate(truth, t)->translation; };

  const auto imu = dataset::read_imu_csv(data / "imu.csv");
  ASSERT_EQ(imu.size(), 226U);  // 2.25 s
  EXPECT_NEAR(imu.front().specific_force_m_s2.norm(), 9.80665, 1e-9);
  EXPECT_EQ(dataset::read_imu_noise(data / "imu.yaml").update_rate_hz, 100.0);

  const dataset::NumberTable air = dataset::read_number_table(data / "barometer.csv");
  ASSERT_EQ(air.rows.size(), 46U);
  for (const auto& row : air.rows) EXPECT_NEAR(row[3], place_at(row[0]).z() + 2700.0, 0.05);

  const dataset::NumberTable field = dataset::read_number_table(data / "magnetometer.csv");
  ASSERT_FALSE(field.rows.empty());
  for (const auto& row : field.rows) EXPECT_NEAR(Vec3(row[1], row[2], row[3]).norm(), 29.0, 1.5);

  const dataset::NumberTable range = dataset::read_number_table(data / "range.csv");
  ASSERT_EQ(range.rows.size(), 23U);
  for (const auto& row : range.rows) {
    const Vec3 p = place_at(row[0]);
    EXPECT_NEAR(row[1], p.z() - TinyPlace::height(p.x(), p.y()), 0.1);
  }

  const geometry::Trajectory scans = geometry::read_tum(data / "lidar/poses.txt");
  ASSERT_EQ(scans.size(), 18U);
  for (std::size_t i = 0; i < scans.size(); ++i) {
    const std::string number = std::to_string(1000000 + i).substr(1);
    const auto points = dataset::read_scan(data / "lidar" / (number + ".ply"));
    EXPECT_GT(points.size(), 1000U);
    EXPECT_NEAR(scans.poses[i].time_s, static_cast<double>(i) / 8, 1e-9);
    expect_ground(points, scans.poses[i].T_local_camera);
  }
  EXPECT_EQ(tests::line_count(file_text(data / "lidar/times.txt")), 18);
  EXPECT_EQ(frames.metadata.at("sensors.lidar.seed"), "1");
  EXPECT_EQ(frames.metadata.at("sensors.imu.rate_hz"), "100");
  EXPECT_FALSE(fs::exists(data / "gps.csv"));  // the place is not on the earth
}

// The place's lens is an equidistant one: EuRoC has a name for it, KITTI has none.
TEST_F(Sensors, ADatasetIsExportedAndReadBack) {
  ASSERT_EQ(render("data", {"--png"}).exit_code, 0);
  const auto exported = [&](const std::string& layout) {
    return run_tileflight(
        {"export", (folder_ / "data").string(), "--layout", layout, "--out", (folder_ / layout).string(), "--json"});
  };
  const ProgramResult euroc = exported("euroc");
  ASSERT_EQ(euroc.exit_code, 0) << euroc.err;
  const dataset::Dataset before = dataset::read_dataset(folder_ / "data"),
                         after = dataset::read_dataset(folder_ / "euroc");
  ASSERT_EQ(after.frames.size(), before.frames.size());
  for (std::size_t i = 0; i < after.frames.size(); ++i) {
    EXPECT_NEAR(after.frames[i].time_s, before.frames[i].time_s, 1e-9);
    EXPECT_TRUE(file_text(after.frames[i].image) == file_text(before.frames[i].image));
  }
  EXPECT_EQ(dataset::read_imu_csv(folder_ / "euroc/mav0/imu0/data.csv").size(), 226U);
  const ProgramResult mcap = exported("mcap");
  EXPECT_EQ(mcap.exit_code, 0) << mcap.err;
  EXPECT_TRUE(file_text(folder_ / "mcap").starts_with("\x89MCAP0\r\n"));
  const ProgramResult kitti = exported("kitti");
  EXPECT_EQ(kitti.exit_code, 1);
  EXPECT_EQ(tests::line_count(kitti.err), 1) << kitti.err;
}

TEST_F(Sensors, ThreadsChangeNothing) {
  ASSERT_EQ(render("one", {"--threads", "1", "--seed", "4"}).exit_code, 0);
  ASSERT_EQ(render("two", {"--threads", "2", "--seed", "4"}).exit_code, 0);
  int files = 0;
  for (const auto& entry : fs::recursive_directory_iterator(folder_ / "one")) {
    if (!entry.is_regular_file()) continue;
    const fs::path name = fs::relative(entry.path(), folder_ / "one");
    EXPECT_TRUE(file_text(entry.path()) == file_text(folder_ / "two" / name)) << name;
    ++files;
  }
  EXPECT_GT(files, 35);
}

TEST_F(Sensors, WhatCannotBeIsOneLine) {
  const auto error_with = [&](const std::string& sensors) {
    const std::string flight(kFlight);
    TinyPlace::write_file(folder_ / "flight.yaml", flight.substr(0, flight.find("sensors:")) + sensors);
    const ProgramResult result = render("bad");
    EXPECT_EQ(result.exit_code, 1);
    EXPECT_EQ(tests::line_count(result.err), 1) << result.err;
    EXPECT_FALSE(fs::exists(folder_ / "bad"));
    return result.err;
  };
  EXPECT_THAT(error_with("sensors: {imo: {}}\n"), ::testing::HasSubstr("did you mean 'imu'?"));
  EXPECT_THAT(error_with("sensors: {magnetometer: {}}\n"), ::testing::HasSubstr("the place is not georeferenced"));
}

}  // namespace
}  // namespace tileflight::sensors_test
