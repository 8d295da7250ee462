#include "tileflight/data/flight_logs/inertial_logs.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <fstream>
#include <random>

#include "tests/refusal.h"
#include "tests/temporary_folder.h"

namespace tileflight::flight_logs::inertial_logs_test {
namespace {

using geometry::Vec3;
using testing::Contains;
using testing::HasSubstr;
using tests::refusal_of;

// The example of Gyroflow's documentation.
const std::string kGcsv =
    "GYROFLOW IMU LOG\nversion,1.3\nid,custom_logger_name\norientation,YxZ\nnote,development, test\n"
    "timestamp,1644159993\ntscale,0.001\ngscale,0.00122173047\nascale,0.00048828125\nt,gx,gy,gz,ax,ay,az\n"
    "0,39,86,183,-1137,-15689,-2986\n1,56,100,202,-1179,-15694,-2887\n";

TEST(Gcsv, ReadingsInTheCamerasAxes) {
  const InertialLog log = parse_gcsv(kGcsv, "x.gcsv");
  ASSERT_EQ(log.readings.size(), 2u);
  EXPECT_DOUBLE_EQ(log.readings[1].time_s, 0.001);
  // YxZ is a unit whose x points right, y up and z back: the camera's axes are x, -y, -z.
  EXPECT_LT((log.readings[0].angular_rate_rad_s - 0.00122173047 * Vec3(39, -86, -183)).norm(), 1e-12);
  EXPECT_LT((log.readings[0].specific_force_m_s2 - 9.80665 * 0.00048828125 * Vec3(-1137, 15689, 2986)).norm(), 1e-12);
  EXPECT_THAT(log.notes, Contains(HasSubstr("T_cam_imu turns nothing")));
}

TEST(Gcsv, EveryMountingTurnsIntoTheSameCamera) {
  // A camera at rest, level: gravity is felt upwards, -y of the camera. Units in all 24 mountings say so.
  const Vec3 up(1, 0, 0), left(0, 1, 0), back(0, 0, 1);  // Gyroflow's axes
  int mountings = 0;
  for (const char a : std::string("XYZxyz"))
    for (const char b : std::string("XYZxyz"))
      for (const char c : std::string("XYZxyz")) {
        const std::string word{a, b, c};
        geometry::Mat3 matrix = geometry::Mat3::Zero();
        for (int row = 0; row < 3; ++row) {
          const char axis = word[static_cast<std::size_t>(row)];
          matrix(row, axis >= 'x' ? axis - 'x' : axis - 'X') = axis >= 'x' ? -1.0 : 1.0;
        }
        if (std::abs(matrix.determinant() - 1.0) > 1e-9) continue;
        ++mountings;
        const Vec3 felt = matrix.transpose() * up, turned = matrix.transpose() * (0.5 * left);
        std::string text = "GYROFLOW IMU LOG\nversion,1.3\nid,x\norientation," + word +
                           "\ntscale,1\ngscale,1\nascale,1\nt,gx,gy,gz,ax,ay,az\n";
        for (int i = 0; i < 2; ++i) {
          text += std::to_string(i);
          for (const Vec3& v : {turned, felt})
            for (int axis = 0; axis < 3; ++axis) text += "," + std::to_string(v[axis]);
          text += "\n";
        }
        const InertialLog log = parse_gcsv(text, "x.gcsv");
        EXPECT_LT((log.readings[0].specific_force_m_s2 - Vec3(0, -9.80665, 0)).norm(), 1e-9) << word;
        EXPECT_LT((log.readings[0].angular_rate_rad_s - Vec3(-0.5, 0, 0)).norm(), 1e-9) << word << ": about the left";
      }
  EXPECT_EQ(mountings, 24);
  EXPECT_GT(back.norm(), 0.0);
}

TEST(Gcsv, Refusals) {
  const auto fault = [](std::string text, const std::string& from, const std::string& to) {
    text.replace(text.find(from), from.size(), to);
    return refusal_of([&] { parse_gcsv(text, "x.gcsv"); });
  };
  EXPECT_THAT(fault(kGcsv, "YxZ", "YYZ"), HasSubstr("'YYZ' does not name"));
  EXPECT_THAT(fault(kGcsv, "YxZ", "YXZ"), HasSubstr("mirrors"));
  EXPECT_THAT(fault(kGcsv, "gscale,0.00122173047\n", ""), HasSubstr("no line 'gscale'"));
  EXPECT_THAT(fault(kGcsv, "gscale,0.0", "gscale,x0.0"), HasSubstr("is no scale"));
  EXPECT_THAT(fault(kGcsv, "t,gx,gy,gz,ax,ay,az", "t,gx,gy,gz"), HasSubstr("no accelerometer"));
  EXPECT_THAT(fault(kGcsv, "t,gx,gy,gz,ax,ay,az", "t,ax,ay,az,gx,gy,gz"), HasSubstr("its columns are not"));
  EXPECT_THAT(fault(kGcsv, "-15694,-2887", "-15694"), HasSubstr("x.gcsv:12"));
  EXPECT_THAT(fault(kGcsv, "1,56", "1,nan"), HasSubstr("x.gcsv:12"));
  const InertialLog own = parse_gcsv(std::string(kGcsv).replace(kGcsv.find("orientation,YxZ\n"), 16, ""), "x.gcsv");
  EXPECT_THAT(own.notes, Contains(HasSubstr("no orientation")));
  EXPECT_GT(own.readings[0].angular_rate_rad_s.x(), 0.0);
}

/// Writes a blackbox log: the encodings and predictors of Betaflight's documentation, the other way round.
class BlackboxWriter {
 public:
  static constexpr const char* kNames =
      "loopIteration,time,axisP[0],axisP[1],axisP[2],rcCommand[0],rcCommand[1],rcCommand[2],rcCommand[3],gyroADC[0],"
      "gyroADC[1],gyroADC[2],vbat,baro";

  std::string bytes;

  void start(const std::string& more = "") {
    bytes +=
        "H Product:Blackbox flight data recorder by Nicholas Sherlock\nH Data version:2\nH I interval:4\nH P "
        "interval:1/1\nH Firmware revision:Betaflight 4.4.0\nH Field I name:" +
        std::string(kNames) + ",accSmooth[0],accSmooth[1],accSmooth[2],motor[0],motor[1]\n" +
        "H Field I signed:0,0,1,1,1,1,1,1,0,1,1,1,0,1,1,1,1,0,0\n"
        "H Field I predictor:0,0,0,0,0,0,0,0,4,0,0,0,9,0,0,0,0,11,5\n"
        "H Field I encoding:1,1,0,0,0,0,0,0,1,0,0,0,3,0,0,0,0,1,0\n"
        "H Field P predictor:6,2,1,1,1,1,1,1,1,3,3,3,1,1,3,3,3,3,3\n"
        "H Field P encoding:9,0,7,7,7,8,8,8,8,10,10,10,6,6,6,6,6,0,0\n"
        "H Field S name:flightModeFlags,stateFlags\nH Field S signed:0,0\nH Field S predictor:0,0\nH Field S "
        "encoding:1,1\n"
        "H vbatref:420\nH minthrottle:1070\nH motorOutput:158,2047\nH gyro_scale:0x3f800000\nH acc_1G:2048\n" +
        more;
  }
  void slow() { bytes += std::string("S\x02\x01"); }
  void end() { bytes += std::string("E\xFF") + "End of log" + '\0'; }

  using Values = std::array<std::int32_t, 19>;
  void intra(const Values& v) {
    bytes += 'I';
    unsigned_value(static_cast<std::uint32_t>(v[0]));
    unsigned_value(static_cast<std::uint32_t>(v[1]));
    for (int i = 2; i < 8; ++i) signed_value(v[at(i)]);
    unsigned_value(static_cast<std::uint32_t>(v[8] - 1070));
    for (int i = 9; i < 12; ++i) signed_value(v[at(i)]);
    unsigned_value(static_cast<std::uint32_t>(420 - v[12]) & 0x3FFFU);
    for (int i = 13; i < 17; ++i) signed_value(v[at(i)]);
    unsigned_value(static_cast<std::uint32_t>(v[17] - 158));
    signed_value(v[18] - v[17]);
    last_ = before_ = v;
  }
  void inter(const Values& v) {
    bytes += 'P';
    const auto average = [&](int i) { return v[at(i)] - (last_[at(i)] + before_[at(i)]) / 2; };
    const auto change = [&](int i) { return v[at(i)] - last_[at(i)]; };
    signed_value(v[1] - (2 * last_[1] - before_[1]));
    tag2({change(2), change(3), change(4)});
    tag8_of_4({change(5), change(6), change(7), change(8)});
    tag2_variable({average(9), average(10), average(11)});
    tag8_of_8({change(12), change(13), average(14), average(15), average(16)});
    signed_value(average(17));
    signed_value(average(18));
    before_ = last_;
    last_ = v;
  }

 private:
  static std::size_t at(int i) { return static_cast<std::size_t>(i); }
  void byte(std::uint32_t value) { bytes += static_cast<char>(value & 0xFFU); }
  void unsigned_value(std::uint32_t value) {
    for (; value > 127U; value >>= 7U) byte(value | 0x80U);
    byte(value);
  }
  void signed_value(std::int32_t value) {
    unsigned_value((static_cast<std::uint32_t>(value) << 1U) ^ (value < 0 ? 0xFFFFFFFFU : 0U));
  }
  static bool fits(std::int32_t value, int bits) { return value >= -(1 << (bits - 1)) && value < (1 << (bits - 1)); }
  static std::uint32_t low(std::int32_t value, int bits) {
    return static_cast<std::uint32_t>(value) & ((1U << static_cast<unsigned>(bits)) - 1U);
  }
  void sized(const std::array<std::int32_t, 3>& v) {
    std::uint32_t header = 0xC0U;
    std::string tail;
    for (unsigned i = 0; i < 3; ++i) {
      unsigned count = 1;
      while (count < 4 && !fits(v[i], static_cast<int>(8 * count))) ++count;
      header |= (count - 1U) << (2U * i);
      for (unsigned k = 0; k < count; ++k)
        tail += static_cast<char>((static_cast<std::uint32_t>(v[i]) >> (8U * k)) & 0xFFU);
    }
    byte(header);
    bytes += tail;
  }
  void tag2(const std::array<std::int32_t, 3>& v) {
    const auto all = [&](int bits) { return fits(v[0], bits) && fits(v[1], bits) && fits(v[2], bits); };
    if (all(2)) {
      byte((low(v[0], 2) << 4U) | (low(v[1], 2) << 2U) | low(v[2], 2));
    } else if (all(4)) {
      byte(0x40U | low(v[0], 4));
      byte((low(v[1], 4) << 4U) | low(v[2], 4));
    } else if (all(6)) {
      byte(0x80U | low(v[0], 6));
      byte(low(v[1], 6));
      byte(low(v[2], 6));
    } else {
      sized(v);
    }
  }
  void tag2_variable(const std::array<std::int32_t, 3>& v) {
    if (fits(v[0], 2) && fits(v[1], 2) && fits(v[2], 2)) {
      byte((low(v[0], 2) << 4U) | (low(v[1], 2) << 2U) | low(v[2], 2));
    } else if (fits(v[0], 5) && fits(v[1], 5) && fits(v[2], 4)) {
      const std::uint32_t packed = (low(v[0], 5) << 9U) | (low(v[1], 5) << 4U) | low(v[2], 4);
      byte(0x40U | (packed >> 8U));
      byte(packed);
    } else if (fits(v[0], 8) && fits(v[1], 7) && fits(v[2], 7)) {
      const std::uint32_t packed = (low(v[0], 8) << 14U) | (low(v[1], 7) << 7U) | low(v[2], 7);
      byte(0x80U | (packed >> 16U));
      byte(packed >> 8U);
      byte(packed);
    } else {
      sized(v);
    }
  }
  void tag8_of_4(const std::array<std::int32_t, 4>& v) {
    std::uint32_t header = 0;
    std::vector<std::uint32_t> halves;
    for (unsigned i = 0; i < 4; ++i) {
      const int bits = v[i] == 0 ? 0 : fits(v[i], 4) ? 4 : fits(v[i], 8) ? 8 : 16;
      header |= (bits == 0 ? 0U : bits == 4 ? 1U : bits == 8 ? 2U : 3U) << (2U * i);
      for (int shift = bits - 4; shift >= 0; shift -= 4)
        halves.push_back((static_cast<std::uint32_t>(v[i]) >> static_cast<unsigned>(shift)) & 15U);
    }
    byte(header);
    if (halves.size() % 2 != 0) halves.push_back(0);
    for (std::size_t i = 0; i < halves.size(); i += 2) byte((halves[i] << 4U) | halves[i + 1]);
  }
  void tag8_of_8(const std::vector<std::int32_t>& v) {
    std::uint32_t header = 0;
    for (std::size_t i = 0; i < v.size(); ++i) header |= (v[i] != 0 ? 1U : 0U) << i;
    byte(header);
    for (const std::int32_t value : v)
      if (value != 0) signed_value(value);
  }

  Values last_{}, before_{};
};

/// A flight with small and large changes, so that every size of every encoding occurs.
std::vector<BlackboxWriter::Values> flight(int frames, std::uint32_t first_us = 1'000'000) {
  std::mt19937 random(3);
  std::vector<BlackboxWriter::Values> all;
  for (int i = 0; i < frames; ++i) {
    BlackboxWriter::Values v{};
    const int size = 1 << (i % 14);  // of the changes
    const auto noise = [&] {
      return static_cast<std::int32_t>(random() % (2U * static_cast<unsigned>(size) + 1U)) - size;
    };
    v[0] = i;
    v[1] = static_cast<std::int32_t>(first_us + static_cast<std::uint32_t>(i) * 500U + (i % 7 == 0 ? 3U : 0U));
    for (std::size_t k = 2; k < 8; ++k) v[k] = noise();
    v[8] = 1500 + noise() % 400;
    for (std::size_t k = 9; k < 12; ++k) v[k] = noise();
    v[12] = 400 + i % 3;
    v[13] = noise();
    v[14] = noise() / 8;
    v[15] = noise() / 8;
    v[16] = 2048 + noise() / 8;
    v[17] = 500 + noise() % 300;
    v[18] = 520 + noise() % 300;
    all.push_back(v);
  }
  return all;
}

std::string written(const std::vector<BlackboxWriter::Values>& all) {
  BlackboxWriter writer;
  writer.start();
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (i % 4 == 0) writer.intra(all[i]);
    if (i % 4 != 0) writer.inter(all[i]);
    if (i % 8 == 0) writer.slow();
  }
  writer.end();
  return writer.bytes;
}

void expect_equal(const InertialLog& log, const std::vector<BlackboxWriter::Values>& all) {
  ASSERT_EQ(log.readings.size(), all.size());
  constexpr double kDegree = 3.14159265358979323846 / 180.0;
  for (std::size_t i = 0; i < all.size(); ++i) {
    const auto& v = all[i];
    const double time_s =
        1e-6 * static_cast<double>(static_cast<std::uint32_t>(v[1]) - static_cast<std::uint32_t>(all[0][1]));
    EXPECT_NEAR(log.readings[i].time_s, time_s, 1e-9) << i;
    EXPECT_LT((log.readings[i].angular_rate_rad_s - kDegree * Vec3(v[9], v[10], v[11])).norm(), 1e-9) << i;
    EXPECT_LT((log.readings[i].specific_force_m_s2 - 9.80665 / 2048.0 * Vec3(v[14], v[15], v[16])).norm(), 1e-9) << i;
  }
}

TEST(Blackbox, DecodesWhatAnEncoderWrote) {
  const auto all = flight(400);
  const InertialLog log = parse_blackbox(written(all), "x.bbl");
  expect_equal(log, all);
  EXPECT_THAT(log.notes, Contains(HasSubstr("x forward, y left, z up")));
}

TEST(Blackbox, TheCounterOfMicrosecondsWraps) {
  const auto all = flight(64, 0xFFFFFFFFU - 10'000U);
  expect_equal(parse_blackbox(written(all), "x.bbl"), all);
}

TEST(Blackbox, EncodingsAreThoseOfTheDocumentation) {
  // The documentation's own example of a group: 13, 0, 4, 2 as 0b01010010, 0x0D, 0x42.
  const std::string header =
      "H Product:Blackbox flight data recorder by Nicholas Sherlock\nH Data version:2\nH Field I name:time,gyroADC[0],"
      "gyroADC[1],gyroADC[2],accSmooth[0],accSmooth[1],accSmooth[2],a\nH Field I predictor:0,0,0,0,0,0,0,0\nH Field I "
      "encoding:1,1,1,1,8,8,8,8\nH Field P predictor:1,1,1,1,1,1,1,1\nH Field P encoding:0,0,0,0,8,8,8,8\nH acc_1G:1\n";
  const std::string group{'\x52', '\x0D', '\x42'};
  // 23456 is 0xA0 0xB7 0x01.
  const std::string log = header + "I\x01\x2A\x7F\xA0\xB7\x01" + group + "P\x02\x01" + std::string("\x01\x02\x00", 3);
  const InertialLog read = parse_blackbox(log, "x.bbl");
  ASSERT_EQ(read.readings.size(), 2u);
  constexpr double kDegree = 3.14159265358979323846 / 180.0;
  EXPECT_LT((read.readings[0].angular_rate_rad_s / kDegree - Vec3(42, 127, 23456)).norm(), 1e-9);
  EXPECT_LT((read.readings[0].specific_force_m_s2 / 9.80665 - Vec3(13, 0, 4)).norm(), 1e-9);
  EXPECT_LT((read.readings[1].angular_rate_rad_s / kDegree - Vec3(41, 126, 23457)).norm(), 1e-9) << "ZigZag: 1, 1, 2";
  EXPECT_DOUBLE_EQ(read.readings[1].time_s, 1e-6);
}

TEST(Blackbox, DamageIsLeftOutAndCounted) {
  const auto all = flight(400);
  std::string bytes = written(all);
  const std::size_t middle = bytes.size() / 2;
  bytes.erase(middle, 37);
  const InertialLog log = parse_blackbox(bytes, "x.bbl");
  EXPECT_GT(log.readings.size(), 380u);
  EXPECT_LT(log.readings.size(), 400u);
  EXPECT_THAT(log.notes, Contains(HasSubstr("damaged")));
  const InertialLog cut = parse_blackbox(std::string_view(bytes).substr(0, middle), "x.bbl");
  EXPECT_GT(cut.readings.size(), 150u);
}

TEST(Blackbox, TheLongestRecordingCounts) {
  const auto first = flight(20), second = flight(120, 9'000'000);
  const InertialLog log = parse_blackbox(written(first) + "noise" + written(second), "x.bbl");
  expect_equal(log, second);
  EXPECT_THAT(log.notes, Contains(HasSubstr("2 recordings")));
}

TEST(Blackbox, Refusals) {
  const auto fault = [](const std::string& bytes) { return refusal_of([&] { parse_blackbox(bytes, "x.bbl"); }); };
  EXPECT_THAT(fault("H Product:Blackbox flight data recorder\nH Data version:1\n"), HasSubstr("version other than 2"));
  EXPECT_THAT(fault("H Product:Blackbox flight data recorder\nH Data version:2\n"), HasSubstr("lack the time"));
  std::string bytes = written(flight(40));
  const std::size_t scale = bytes.find("0x3f800000");
  EXPECT_THAT(fault(std::string(bytes).replace(scale, 10, "0x7f800000")), HasSubstr("gyro_scale"));
  auto still = flight(40);
  for (auto& values : still)
    for (std::size_t i = 0; i < 3; ++i) values[14 + i] = 0;
  EXPECT_THAT(fault(written(still)), HasSubstr("its accelerometer was off: all readings are 0"));
  std::mt19937 random(5);
  for (int i = 0; i < 200; ++i) {
    std::string changed = bytes;
    for (int k = 0; k < 8; ++k) changed[random() % changed.size()] = static_cast<char>(random());
    fault(changed);  // neither crashes nor hangs
  }
  fault(bytes.substr(0, bytes.find("S\x02\x01")) + std::string(100000, 'I'));
}

TEST(BlackboxCsv, OfTheDecoder) {
  const std::string text =
      "loopIteration, time (us), axisP[0], gyroADC[0], gyroADC[1], gyroADC[2], accSmooth[0], accSmooth[1], "
      "accSmooth[2]\n"
      "0, 1000000, 5, 90, -180, 1, 0, 0, 2048\n1, 1000500, 5, 45, 0, 0, 0, 1024, 2048\n2, 1001000, 5, 0, 0, 0, 0, 0, "
      "2010\n";
  const InertialLog log = parse_blackbox_csv(text, "x.csv");
  ASSERT_EQ(log.readings.size(), 3u);
  EXPECT_DOUBLE_EQ(log.readings[1].time_s, 0.0005);
  EXPECT_NEAR(log.readings[0].angular_rate_rad_s.x(), 1.5707963, 1e-6);
  EXPECT_NEAR(log.readings[0].specific_force_m_s2.z(), 9.80665, 1e-9);
  EXPECT_THAT(log.notes, Contains(HasSubstr("2048 is assumed")));
  EXPECT_THAT(log.notes, Contains(HasSubstr("degrees a second are assumed")));
}

TEST(BlackboxCsv, OfTheExplorerAndWithUnits) {
  const InertialLog explorer = parse_blackbox_csv(
      "\"Product\",\"Blackbox flight data recorder by Nicholas "
      "Sherlock\"\n\"acc_1G\",4096\n\"gyro_scale\",\"0x3f800000\"\n"
      "\"loopIteration\",\"time\",\"gyroADC[0]\",\"gyroADC[1]\",\"gyroADC[2]\",\"accSmooth[0]\",\"accSmooth[1]\","
      "\"accSmooth[2]\"\n0,0,180,0,0,0,0,4096\n1,500,180,0,0,0,0,4096\n",
      "x.csv");
  EXPECT_NEAR(explorer.readings[0].angular_rate_rad_s.x(), 3.1415927, 1e-6);
  EXPECT_NEAR(explorer.readings[0].specific_force_m_s2.z(), 9.80665, 1e-9);
  const InertialLog units = parse_blackbox_csv(
      "loopIteration, time (us), gyroADC[0] (rad/s), gyroADC[1] (rad/s), gyroADC[2] (rad/s), accSmooth[0] (g), "
      "accSmooth[1] (g), accSmooth[2] (g)\n0, 0, 1.5, 0, 0, 0, 0, 1\n1, 500, 1.5, 0, 0, 0, 0, 1\n",
      "x.csv");
  EXPECT_DOUBLE_EQ(units.readings[0].angular_rate_rad_s.x(), 1.5);
  EXPECT_DOUBLE_EQ(units.readings[0].specific_force_m_s2.z(), 9.80665);
}

TEST(BlackboxCsv, Refusals) {
  const std::string names =
      "loopIteration, time (us), gyroADC[0], gyroADC[1], gyroADC[2], accSmooth[0], accSmooth[1], accSmooth[2]\n";
  const auto fault = [](const std::string& text) { return refusal_of([&] { parse_blackbox_csv(text, "x.csv"); }); };
  EXPECT_THAT(fault("a,b\n"), HasSubstr("no column loopIteration"));
  EXPECT_THAT(fault("loopIteration, time (us), motor[0]\n0,0,1\n"), HasSubstr("lacks the time, gyroADC or accSmooth"));
  EXPECT_THAT(fault(names + "0,0,1,1,1,0,0,700\n1,500,1,1,1,0,0,700\n"), HasSubstr("--unit-acceleration g"));
  EXPECT_THAT(fault(names + "0,0,1,1,1,0,0,2048\n1,500,1,1\n"), HasSubstr("x.csv:3"));
  EXPECT_THAT(fault(names + "0,0,1,1,1,0,0,0\n1,500,1,1,1,0,0,0\n"), HasSubstr("its accelerometer was off"));
}

TEST(InertialLogs, AreKnownByTheirFirstBytes) {
  const tests::TemporaryFolder folder;
  const auto readings = [&](const std::string& name, const std::string& bytes) {
    std::ofstream(folder / name, std::ios::binary) << bytes;
    EXPECT_TRUE(is_inertial_log(std::string_view(bytes).substr(0, 4096))) << name;
    return read_inertial_log(folder / name).readings.size();
  };
  EXPECT_EQ(readings("a.gcsv", kGcsv), 2u);
  EXPECT_EQ(readings("b.bbl", written(flight(40))), 40u);
  EXPECT_FALSE(is_inertial_log("t,gx,gy,gz,ax,ay,az\n0,1,2,3,4,5,6\n"));
  EXPECT_FALSE(is_inertial_log("#timestamp [ns],w_RS_S_x [rad s^-1]\n"));
}

}  // namespace
}  // namespace tileflight::flight_logs::inertial_logs_test
