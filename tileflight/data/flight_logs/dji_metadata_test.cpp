// An encoder of protocol buffers written from their documentation, apart from the reader, makes the messages. No
// recording of a DJI is at hand: that the numbers of the fields are right rests on the sources that
// dji_metadata.cpp names.
#include <gmock/gmock.h>

#include <cstring>

#include "tests/refusal.h"
#include "tileflight/data/flight_logs/metadata_tracks.h"

namespace tileflight::flight_logs::dji_metadata_test {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

std::string varint(std::uint64_t value) {
  std::string bytes;
  for (; value >= 128; value /= 128) bytes += static_cast<char>(value % 128 + 128);
  return bytes + static_cast<char>(value);
}
std::string number(int field, std::int64_t value) {
  return varint(8U * static_cast<unsigned>(field)) + varint(static_cast<std::uint64_t>(value));
}
template <class Number>
std::string fixed(int field, Number value, unsigned type) {
  std::string bytes(sizeof value, '\0');
  std::memcpy(bytes.data(), &value, sizeof value);
  return varint(8U * static_cast<unsigned>(field) + type) + bytes;
}
std::string real(int field, double value) { return fixed(field, value, 1); }
std::string real(int field, float value) { return fixed(field, value, 5); }
std::string message(int field, const std::string& content) {
  return varint(8U * static_cast<unsigned>(field) + 2) + varint(content.size()) + content;
}
std::string quotient(int field, int numerator, int denominator) {
  return message(field,
                 message(1, varint(static_cast<unsigned>(numerator)) + varint(static_cast<unsigned>(denominator))));
}

/// The header of the first frame's message.
std::string header(const std::string& proto, const std::string& product = "") {
  return message(
      1, message(1, message(1, proto) + message(2, "02.01.16") + (product.empty() ? "" : message(10, product))));
}

struct Receiver {
  double latitude = 47.1, longitude = 8.2;
  std::int64_t height_mm = 500250;
  int unit = 1, status = 0, kind = 0;
  std::string time;

  std::string encoded() const {
    return message(1, (unit != 0 ? number(1, unit) : "") + real(2, latitude) + real(3, longitude)) +
           number(2, height_mm) + (status != 0 ? number(3, status) : "") + (kind != 0 ? number(4, kind) : "") +
           (time.empty() ? "" : number(5, 1) + message(6, message(1, time)));
  }
};

/// A frame of the Mini 4 Pro.
std::string mini4(const Receiver& receiver, float above_mm = 40500.0F, double exposure = 0.002) {
  const std::string drone = message(3, number(1, -120) + number(2, 35) + number(3, -1790)) +
                            message(4, receiver.encoded()) + message(5, above_mm != 0 ? real(1, above_mm) : "");
  const std::string gimbal = message(3, number(1, -900) + number(3, 451));
  const std::string lens = message(7, real(1, 200.0F)) + quotient(10, 1, static_cast<int>(1 / exposure));
  return message(
      3, message(1, number(1, 7) + number(2, 123456)) + message(2, lens) + message(3, drone) + message(4, gimbal));
}

Telemetry read(const std::vector<std::string>& messages) {
  std::vector<base::TimedBytes> samples;
  for (const std::string& one : messages) {
    const auto* const data = reinterpret_cast<const std::byte*>(one.data());
    samples.push_back({static_cast<double>(samples.size()) / 30.0, 1 / 30.0, {data, data + one.size()}});
  }
  return read_dji_metadata(samples, {.where = "a.mp4"});
}
std::string fault(const std::vector<std::string>& messages) {
  return tests::refusal_of([&] { read(messages); });
}

const std::string kMini4 = header("dvtm_Mini4_Pro.proto", "DJI Mini 4 Pro");

TEST(DjiMetadata, AFrameHasPositionHeightsAnglesAndExposure) {
  const Telemetry log = read({kMini4 + mini4({}), mini4({.longitude = 8.2001, .time = "2025-06-01 12-30-15"})});
  ASSERT_EQ(log.fixes.size(), 2U);
  const TelemetryFix& fix = log.fixes[1];
  EXPECT_EQ(fix.time_s, 1 / 30.0);
  EXPECT_EQ(fix.latitude_deg, 47.1);
  EXPECT_EQ(fix.longitude_deg, 8.2001);
  EXPECT_NEAR(*fix.absolute_height_m, 500.25, 1e-9);
  EXPECT_NEAR(*fix.height_above_takeoff_m, 40.5, 1e-9);
  EXPECT_NEAR(*fix.body_pitch_deg, -12.0, 1e-9) << "in the order of DJI's own library";
  EXPECT_NEAR(*fix.body_roll_deg, 3.5, 1e-9);
  EXPECT_NEAR(*fix.body_yaw_deg, -179.0, 1e-9);
  EXPECT_NEAR(*fix.gimbal_pitch_deg, -90.0, 1e-9);
  EXPECT_EQ(*fix.gimbal_roll_deg, 0.0) << "a zero is not written";
  EXPECT_NEAR(*fix.gimbal_yaw_deg, 45.1, 1e-9);
  EXPECT_EQ(log.height_datum, HeightDatum::kUnknown) << "the barometer's";
  EXPECT_NEAR(*log.zero_utc_s, 1748781015.0 - 1 / 30.0, 1e-6) << "date -u -d '2025-06-01 12:30:15' +%s";
  ASSERT_EQ(log.exposures.size(), 2U);
  EXPECT_NEAR(log.exposures[1].exposure_s, 0.002, 1e-12);
  EXPECT_EQ(*log.exposures[1].gain, 200.0);
  EXPECT_EQ(log.device, "DJI Mini 4 Pro");
  EXPECT_THAT(log.warnings, IsEmpty());
}

TEST(DjiMetadata, TheKindOfHeightIsItsReference) {
  const auto datum = [](int first, int second) {
    return read({kMini4 + mini4({.kind = first}), mini4({.kind = second})}).height_datum;
  };
  EXPECT_EQ(datum(0, 0), HeightDatum::kUnknown);
  EXPECT_EQ(datum(1, 1), HeightDatum::kEllipsoid);
  EXPECT_EQ(datum(2, 1), HeightDatum::kEllipsoid);
  EXPECT_EQ(datum(0, 1), HeightDatum::kUnknown);
  EXPECT_THAT(read({kMini4 + mini4({.kind = 0}), mini4({.kind = 1})}).warnings,
              ElementsAre(HasSubstr("the heights change between the barometer's and")));
}

TEST(DjiMetadata, AHeightOfTakeoffIsNotWrittenAndIsZero) {
  EXPECT_EQ(*read({kMini4 + mini4({}, 0.0F)}).fixes[0].height_above_takeoff_m, 0.0);
}

/// Numbers below zero in ten bytes, as protocol buffers have them, and in five, as some firmware writes them.
TEST(DjiMetadata, HeightsMayBeBelowZero) {
  EXPECT_NEAR(*read({kMini4 + mini4({.height_mm = -12500})}).fixes[0].absolute_height_m, -12.5, 1e-9);
  EXPECT_NEAR(*read({kMini4 + mini4({.height_mm = (std::int64_t{1} << 32) - 12500})}).fixes[0].absolute_height_m, -12.5,
              1e-9);
}

TEST(DjiMetadata, CoordinatesAreInTheUnitThatTheyState) {
  const Receiver radians{.latitude = 0.8220500776893293, .longitude = -0.1431169986635354, .unit = 0};
  const Telemetry log = read({kMini4 + mini4(radians)});
  EXPECT_NEAR(log.fixes[0].latitude_deg, 47.1, 1e-12);
  EXPECT_NEAR(log.fixes[0].longitude_deg, -8.2, 1e-12);
  // The Mavic 4 Pro's are in degrees although the unit is missing, which means radians.
  const std::string mavic4 =
      header("dvtm_Mavic4.proto") + message(3, message(3, message(4, Receiver{.unit = 0}.encoded())));
  EXPECT_EQ(read({mavic4}).fixes[0].latitude_deg, 47.1);
}

TEST(DjiMetadata, FramesWithoutAFixAreDroppedAndCounted) {
  const Telemetry log = read(
      {kMini4 + mini4({.status = 1}), mini4({.latitude = 0, .longitude = 0}), mini4({}), mini4({.latitude = 200})});
  EXPECT_EQ(log.fixes.size(), 1U);
  EXPECT_THAT(log.warnings, ElementsAre("2 entries dropped: no position fix",
                                        "1 entries dropped: latitude or longitude out of range"));
}

/// The Avata 2 has its drone where the Mini has its gimbal.
TEST(DjiMetadata, EachModelHasItsOwnNumbers) {
  const std::string drone =
      message(3, number(1, 15)) + message(4, Receiver{.kind = 1}.encoded()) + message(5, real(1, 2500.0F));
  const std::string lens = message(2, real(1, 100.0F)) + quotient(4, 1, 240);
  const Telemetry log = read({header("dvtm_AVATA2.proto") + message(3, message(2, lens) + message(4, drone))});
  ASSERT_EQ(log.fixes.size(), 1U);
  EXPECT_NEAR(*log.fixes[0].height_above_takeoff_m, 2.5, 1e-9);
  EXPECT_NEAR(*log.fixes[0].body_pitch_deg, 1.5, 1e-9);
  EXPECT_FALSE(log.fixes[0].gimbal_pitch_deg);
  EXPECT_NEAR(log.exposures[0].exposure_s, 1 / 240.0, 1e-12);
  EXPECT_EQ(log.device, "DJI Avata 2");
  EXPECT_EQ(log.height_datum, HeightDatum::kEllipsoid);
}

TEST(DjiMetadata, FocalLengthAndZoomAreThoseOfEachFrame) {
  const auto frame = [](int focal_length, float zoom) {
    return message(3, message(2, message(5, real(1, zoom)) + quotient(10, focal_length, 1000)));
  };
  const Telemetry log = read({header("dvtm_eagle4_wa530.proto") + frame(24000, 1.0F), frame(48000, 2.0F)});
  ASSERT_EQ(log.zooms.size(), 2U);
  EXPECT_EQ(*log.zooms[1].focal_length, 48.0);
  EXPECT_EQ(*log.zooms[1].digital_zoom, 2.0);
  EXPECT_THAT(find_zoom_warnings(log.zooms, "the metadata"),
              ElementsAre(HasSubstr("the focal length changes by a factor of 2")));
}

/// The O3 air unit records no positions.
TEST(DjiMetadata, AModelMayHaveNoReceiver) {
  const Telemetry log = read({header("dvtm_wm169.proto") + message(3, message(2, quotient(4, 1, 100)))});
  EXPECT_THAT(log.fixes, IsEmpty());
  EXPECT_EQ(log.exposures.size(), 1U);
  EXPECT_THAT(log.warnings, IsEmpty());
}

TEST(DjiMetadata, AnUnknownModelIsNamedAndNotGuessed) {
  EXPECT_THAT(fault({header("dvtm_Mini9.proto") + mini4({})}),
              AllOf(HasSubstr("a.mp4"), HasSubstr("is defined by dvtm_Mini9.proto"), HasSubstr("give the .srt")));
  EXPECT_THAT(fault({header("dvtm_\x01\n.proto") + mini4({})}), HasSubstr("dvtm_??.proto"));
  EXPECT_THAT(fault({mini4({})}), HasSubstr("does not name its definition"));
  EXPECT_THAT(fault({kMini4}), HasSubstr("holds nothing that can be read"));
}

TEST(DjiMetadata, AFrameMayEndAnywhere) {
  const std::string next = mini4({.longitude = 8.3});
  for (std::size_t size = 1; size < next.size(); ++size) {
    const Telemetry log = read({kMini4 + mini4({}), next.substr(0, size)});
    EXPECT_EQ(log.fixes.size(), 1U) << size;
    EXPECT_THAT(log.warnings, ElementsAre("1 frames of the metadata track are damaged and left out")) << size;
  }
  const std::string first = kMini4 + next;
  for (std::size_t size = 0; size < first.size(); ++size) fault({first.substr(0, size)});
}

TEST(DjiMetadata, HostileFieldsAreNotBelieved) {
  const auto with = [](const std::string& field) { return read({kMini4 + mini4({}), field}).warnings; };
  const std::string damaged = "1 frames of the metadata track are damaged and left out";
  EXPECT_THAT(with(std::string(20, '\xFF')), Contains(damaged)) << "a number without an end";
  EXPECT_THAT(with(varint(8 * 3 + 2) + varint(~std::uint64_t{0})), Contains(damaged)) << "a length beyond all";
  EXPECT_THAT(with("\x1B\x1C"), Contains(damaged)) << "groups";
  EXPECT_THAT(with(std::string(1, '\0')), Contains(damaged)) << "field 0";
  std::string deep;
  for (int i = 0; i < 5000; ++i) deep = message(3, deep);
  EXPECT_THAT(with(deep), Contains("1 entries dropped: no position fix"));
  EXPECT_THAT(with(message(3, message(2, message(10, message(1, varint(1) + varint(0)))))),
              Contains("1 entries dropped: no position fix"))
      << "an exposure without a denominator";
}

}  // namespace
}  // namespace tileflight::flight_logs::dji_metadata_test
