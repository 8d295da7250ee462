#include <gmock/gmock.h>

#include <cmath>
#include <cstdint>
#include <fstream>
#include <numbers>

#include "tests/temporary_folder.h"
#include "tests/test_data.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/test_bytes.h"
#include "tileflight/data/flight_logs/telemetry.h"
#include "tileflight/data/flight_logs/test_log.h"

namespace tileflight::flight_logs::ulog_test {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::ThrowsMessage;

std::string message(char letter, const std::string& payload) {
  return base::to_raw_bytes(static_cast<std::uint16_t>(payload.size())) + letter + payload;
}

std::string header() { return std::string("ULog\x01\x12\x35\x01", 8) + base::to_raw_bytes(std::uint64_t{1000000}); }

std::string flags(std::uint64_t incompatible, std::uint64_t appended) {
  return message('B', base::to_raw_bytes(std::uint64_t{0}) + base::to_raw_bytes(incompatible) +
                          base::to_raw_bytes(appended) + std::string(16, '\0'));
}

std::string subscription(std::uint16_t id, const std::string& topic, std::uint8_t instance = 0) {
  return message('A', base::to_raw_bytes(instance) + base::to_raw_bytes(id) + topic);
}

const std::string kSync = message('S', "\x2F\x73\x13\x20\x25\x0C\xBB\x12");

/// A receiver's topic as before PX4 1.14, with a nested format, an array and padding before the wanted fields.
const std::string kReceiver =
    message('F',
            "vehicle_gps_position:uint64_t timestamp;part[2] parts;int32_t lat;int32_t lon;int32_t alt;"
            "int32_t alt_ellipsoid;uint8_t fix_type;uint8_t[3] _padding0;") +
    message('F', "part:float a;uint8_t[2] b;") + subscription(7, "vehicle_gps_position");

std::string receiver_row(double time_s, double latitude_deg, std::uint8_t fix_type = 3, std::uint16_t id = 7) {
  return message('D', base::to_raw_bytes(id) +
                          base::to_raw_bytes(static_cast<std::uint64_t>(std::llround(1e6 * time_s))) +
                          std::string(12, '\x55') +
                          base::to_raw_bytes(static_cast<std::int32_t>(std::llround(1e7 * latitude_deg))) +
                          base::to_raw_bytes(std::int32_t{-785000000}) + base::to_raw_bytes(std::int32_t{2900500}) +
                          base::to_raw_bytes(std::int32_t{2926250}) + base::to_raw_bytes(fix_type));
}

const std::string kAttitude =
    message('F', "vehicle_attitude:uint64_t timestamp;float[4] q;") + subscription(9, "vehicle_attitude");

std::string attitude_row(double time_s, float w, float x, float y, float z) {
  return message('D', base::to_raw_bytes(std::uint16_t{9}) +
                          base::to_raw_bytes(static_cast<std::uint64_t>(std::llround(1e6 * time_s))) +
                          base::to_raw_bytes(w) + base::to_raw_bytes(x) + base::to_raw_bytes(y) +
                          base::to_raw_bytes(z));
}

class Ulog : public LogTest {
 protected:
  Ulog() : LogTest("log.ulg", read_ulog) {}
};

TEST_F(Ulog, PositionsOfTheFirstReceiver) {
  const Telemetry log = read(header() + flags(0, 0) + kReceiver + subscription(8, "vehicle_gps_position", 1) +
                             receiver_row(20, -0.25) + receiver_row(20, 45, 3, 8) + kSync + receiver_row(20.2, -0.26));
  ASSERT_EQ(log.fixes.size(), 2u);
  EXPECT_EQ(log.fixes[0].time_s, 0.0);
  EXPECT_NEAR(log.fixes[1].time_s, 0.2, 1e-9);
  EXPECT_NEAR(log.fixes[1].latitude_deg, -0.26, 1e-12);
  EXPECT_NEAR(log.fixes[0].longitude_deg, -78.5, 1e-12);
  EXPECT_NEAR(*log.fixes[0].absolute_height_m, 2926.25, 1e-9);
  EXPECT_EQ(log.height_datum, HeightDatum::kEllipsoid);
  EXPECT_THAT(log.warnings, IsEmpty());
}

TEST_F(Ulog, NewerReceiversAndEstimatorsSayDegreesAndMetres) {
  const auto row = [](double altitude_m, double ellipsoid_m) {
    return message('D', base::to_raw_bytes(std::uint16_t{0}) + base::to_raw_bytes(std::uint64_t{5}) +
                            base::to_raw_bytes(45.5) + base::to_raw_bytes(9.25) + base::to_raw_bytes(altitude_m) +
                            base::to_raw_bytes(ellipsoid_m));
  };
  const std::string receiver = header() +
                               message('F',
                                       "sensor_gps:uint64_t timestamp;double latitude_deg;double longitude_deg;"
                                       "double altitude_msl_m;double altitude_ellipsoid_m;") +
                               subscription(0, "sensor_gps");
  EXPECT_EQ(read(receiver + row(100.5, 148.5)).fixes.at(0).absolute_height_m, 148.5);
  EXPECT_EQ(read(receiver + row(100.5, 0)).fixes.at(0).absolute_height_m, 100.5);
  EXPECT_EQ(read(receiver + row(100.5, 0)).height_datum, HeightDatum::kMeanSeaLevel);
  const std::string estimator =
      header() + message('F', "vehicle_global_position:uint64_t timestamp;double lat;double lon;double alt;") +
      subscription(0, "vehicle_global_position");
  const Telemetry log = read(estimator + row(100.5, 0));
  EXPECT_EQ(log.fixes.at(0).latitude_deg, 45.5);
  EXPECT_EQ(log.fixes.at(0).absolute_height_m, 100.5);
  EXPECT_EQ(log.height_datum, HeightDatum::kMeanSeaLevel);
}

TEST_F(Ulog, AttitudeNextInTime) {
  const auto half = static_cast<float>(std::numbers::sqrt2 / 2);
  const Telemetry log = read(header() + kReceiver + kAttitude + attitude_row(9.95, half, 0, 0, half) +
                             attitude_row(10.1, half, 0, half, 0) + attitude_row(11.1, half, half, 0, 0) +
                             receiver_row(10, 45) + receiver_row(11, 45) + receiver_row(12, 45));
  ASSERT_EQ(log.fixes.size(), 3u);
  EXPECT_NEAR(*log.fixes[0].body_yaw_deg, 90, 1e-4);  // nose to the east
  EXPECT_NEAR(*log.fixes[0].body_pitch_deg, 0, 1e-4);
  EXPECT_NEAR(*log.fixes[1].body_roll_deg, 90, 1e-4);  // right side down
  EXPECT_EQ(log.fixes[2].body_roll_deg, std::nullopt);
  const Telemetry up =
      read(header() + kReceiver + kAttitude + attitude_row(10, half, 0, half, 0) + receiver_row(10, 45));
  EXPECT_NEAR(*up.fixes[0].body_pitch_deg, 90, 0.1);  // nose up
}

TEST_F(Ulog, TurningRatesOfTheControllerElseOfTheSensor) {
  const auto row = [](std::uint16_t id, double time_s, float x) {
    return message('D', base::to_raw_bytes(id) +
                            base::to_raw_bytes(static_cast<std::uint64_t>(std::llround(1e6 * time_s))) +
                            base::to_raw_bytes(x) + base::to_raw_bytes(2.0F) + base::to_raw_bytes(3.0F));
  };
  const std::string sensor = header() + kReceiver + receiver_row(10, 45) +
                             message('F', "sensor_combined:uint64_t timestamp;float[3] gyro_rad;") +
                             subscription(11, "sensor_combined") + row(11, 9.5, 0.5F) + row(11, 11, 0.25F);
  const Telemetry raw_rates = read(sensor);
  ASSERT_EQ(raw_rates.body_rates.size(), 2u);
  EXPECT_NEAR(raw_rates.body_rates[0].time_s, -0.5, 1e-9);  // on the clock of the fixes
  EXPECT_EQ(raw_rates.body_rates[1].rate_rad_s, geometry::Vec3(0.25, 2, 3));
  const Telemetry filtered = read(sensor + message('F', "vehicle_angular_velocity:uint64_t timestamp;float[3] xyz;") +
                                  subscription(12, "vehicle_angular_velocity") + row(12, 10.5, 7));
  ASSERT_EQ(filtered.body_rates.size(), 1u);
  EXPECT_EQ(filtered.body_rates[0].rate_rad_s.x(), 7);
}

TEST_F(Ulog, DropoutsBrokenStretchesAndMissingFixesAreCounted) {
  const Telemetry log =
      read(header() + kReceiver + receiver_row(1, 45, 2) + receiver_row(2, 45) +
           message('O', base::to_raw_bytes(std::uint16_t{30})) + message('O', base::to_raw_bytes(std::uint16_t{12})) +
           std::string(50, '\xEE') + kSync + receiver_row(3, 45) + "\x40");
  EXPECT_EQ(log.fixes.size(), 2u);
  EXPECT_THAT(log.warnings, ElementsAre("1 entries dropped: no position fix",
                                        "2 dropouts of the logger, 42 ms in total", "50 unreadable bytes skipped",
                                        "the file ends within a message; everything before it is used"));
}

TEST_F(Ulog, DataAppendedAfterACutMessageIsRead) {
  const std::string cut = kReceiver + receiver_row(1, 45) + receiver_row(2, 45).substr(0, 20);
  const std::size_t offset = header().size() + flags(1, 0).size() + cut.size();
  const Telemetry log = read(header() + flags(1, offset) + cut + receiver_row(3, 45));
  EXPECT_EQ(log.fixes.size(), 2u);
  EXPECT_THAT(log.warnings, IsEmpty());
}

TEST_F(Ulog, UnusableFilesAreOneClearLine) {
  EXPECT_THAT(fault(""), HasSubstr("log.ulg: is not a ULog file"));
  EXPECT_THAT(fault(header().substr(0, 12)), HasSubstr("is truncated within the header"));
  EXPECT_THAT(fault(header()), HasSubstr("contains no position messages"));
  EXPECT_THAT(fault(header() + flags(2, 0)), HasSubstr("incompatible flags"));
  EXPECT_THAT(fault(header() + kReceiver + receiver_row(1, 45, 1)),
              HasSubstr("none of its 1 position messages has a time and a position"));
  EXPECT_THAT([&] { read_ulog(folder_ / "absent.ulg"); },
              ThrowsMessage<InputError>(HasSubstr("absent.ulg: cannot be opened")));
}

TEST_F(Ulog, FormatsThatNestInACircleOrThousandfoldAreBounded) {
  const std::string row = message('D', base::to_raw_bytes(std::uint16_t{1}) + std::string(64, '\x01'));
  const std::string circle = message('F', "vehicle_gps_position:a x;uint64_t timestamp;int32_t lat;int32_t lon;") +
                             message('F', "a:b x;") + message('F', "b:a[60000] x;");
  EXPECT_THAT(fault(header() + circle + subscription(1, "vehicle_gps_position") + row), HasSubstr("no position fix"));
  std::string wide = message('F', "vehicle_gps_position:l0 x;uint64_t timestamp;int32_t lat;int32_t lon;");
  for (int level = 0; level < 7; ++level) {
    std::string fields;
    for (int i = 0; i < 500; ++i) fields += "l" + std::to_string(level + 1) + "[0] x;";
    wide += message('F', "l" + std::to_string(level) + ":" + fields);
  }
  wide += message('F', "l7:uint8_t x;");
  EXPECT_THAT(fault(header() + wide + subscription(1, "vehicle_gps_position") + row), HasSubstr("no position fix"));
}

TEST_F(Ulog, CutAtEveryByteGivesTheWholeMessagesBefore) {
  const std::string first =
      header() + flags(0, 0) + kReceiver + kAttitude + attitude_row(1, 1, 0, 0, 0) + receiver_row(1, 45);
  const std::string whole = first + kSync + receiver_row(2, 45);
  for (std::size_t bytes = 0; bytes < whole.size(); ++bytes) {
    const std::string text = whole.substr(0, bytes);
    if (bytes < first.size()) {
      EXPECT_NE(fault(text), "no error") << bytes;
      continue;
    }
    const Telemetry log = read(text);
    EXPECT_EQ(log.fixes.size(), 1u) << bytes;
    const bool at_end_of_message = bytes == first.size() || bytes == first.size() + kSync.size();
    EXPECT_EQ(log.warnings.size(), at_end_of_message ? 0u : 1u) << bytes;
  }
  EXPECT_EQ(read(whole).fixes.size(), 2u);
}

TEST_F(Ulog, EachByteChangedIsReadOrRefused) {
  const std::string whole = header() + flags(0, 0) + kReceiver + kAttitude + attitude_row(1, 1, 0, 0, 0) +
                            receiver_row(1, 45) + kSync + receiver_row(2, 45);
  for (std::size_t at = 0; at < whole.size(); ++at) {
    for (const char changed : {'\0', '\x7F', '\xFF'}) {
      std::string bytes = whole;
      bytes[at] = changed;
      const std::string said = fault(bytes);
      EXPECT_THAT(said, testing::AnyOf("no error", HasSubstr("log.ulg: "))) << at;
    }
  }
}

/// A short hop of a real vehicle; the numbers were decoded from the bytes by hand.
TEST(RealUlog, SampleOfPx4) {
  TILEFLIGHT_REQUIRE_TEST_DATA(file, "logs/px4_ulog/sample_log_small.ulg");
  const Telemetry log = read_telemetry(file);
  ASSERT_EQ(log.fixes.size(), 32u);
  const TelemetryFix& first = log.fixes.front();
  EXPECT_NEAR(first.latitude_deg, 63.4170622, 1e-9);
  EXPECT_NEAR(first.longitude_deg, 10.4082151, 1e-9);
  EXPECT_NEAR(*first.absolute_height_m, 106.766, 1e-9);
  EXPECT_NEAR(log.fixes.back().time_s, 26.658637 - 20.471648, 1e-9);
  EXPECT_NEAR(*log.fixes.back().absolute_height_m, 102.929, 1e-9);
  EXPECT_EQ(log.height_datum, HeightDatum::kEllipsoid);
  EXPECT_THAT(log.warnings, ElementsAre("1 dropouts of the logger, 30 ms in total"));
  EXPECT_NEAR(*first.body_yaw_deg, 13.1647, 1e-3);
  EXPECT_GT(log.body_rates.size(), 100u);
}

TEST(RealUlog, CutAnywhereIsReadAsFarAsItGoes) {
  TILEFLIGHT_REQUIRE_TEST_DATA(file, "logs/px4_ulog/sample_log_small.ulg");
  const std::string whole = base::read_text(file);
  const tests::TemporaryFolder folder;
  std::size_t fixes = 0;
  for (std::size_t bytes = whole.size() / 2; bytes < whole.size(); bytes += 30011) {
    std::ofstream(folder / "cut.ulg", std::ios::binary) << whole.substr(0, bytes);
    const Telemetry log = read_ulog(folder / "cut.ulg");
    EXPECT_GE(log.fixes.size(), fixes);
    fixes = log.fixes.size();
  }
  EXPECT_GT(fixes, 16u);
}

}  // namespace
}  // namespace tileflight::flight_logs::ulog_test
