#include "tileflight/data/flight_logs/photo_log.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <sstream>

#include "tests/refusal.h"
#include "tests/run_program.h"
#include "tests/temporary_folder.h"
#include "tests/test_data.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/base/test_bytes.h"
#include "tileflight/data/flight_logs/telemetry.h"

namespace tileflight::flight_logs::photo_log_test {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

/// A little-endian TIFF directory as EXIF has it (TIFF 6.0, section 2): values longer than four bytes follow it.
class Directory {
 public:
  void text(std::uint16_t tag, std::string value) {
    value += '\0';
    add(tag, 2, static_cast<std::uint32_t>(value.size()), value);
  }
  void byte(std::uint16_t tag, std::uint8_t value) { add(tag, 1, 1, base::to_raw_bytes(value)); }
  void word(std::uint16_t tag, std::uint16_t value) { add(tag, 3, 1, base::to_raw_bytes(value)); }
  void offset(std::uint16_t tag, std::uint32_t value) { add(tag, 4, 1, base::to_raw_bytes(value)); }
  void fractions(std::uint16_t tag, const std::vector<std::pair<std::uint32_t, std::uint32_t>>& values) {
    std::string bytes;
    for (const auto& [numerator, denominator] : values)
      bytes += base::to_raw_bytes(numerator) + base::to_raw_bytes(denominator);
    add(tag, 5, static_cast<std::uint32_t>(values.size()), bytes);
  }
  std::size_t size() const {
    std::size_t bytes = 2 + 12 * entries_.size() + 4;
    for (const Entry& entry : entries_) bytes += entry.value.size() > 4 ? entry.value.size() : 0;
    return bytes;
  }
  /// The directory's bytes at offset `at` from the TIFF header.
  std::string bytes(std::size_t at) const {
    std::string out = base::to_raw_bytes(static_cast<std::uint16_t>(entries_.size())), behind;
    const std::size_t values_at = at + 2 + 12 * entries_.size() + 4;
    for (const Entry& entry : entries_) {
      out += base::to_raw_bytes(entry.tag) + base::to_raw_bytes(entry.type) + base::to_raw_bytes(entry.count);
      if (entry.value.size() <= 4) {
        std::string value = entry.value;
        value.resize(4);
        out += value;
      } else {
        out += base::to_raw_bytes(static_cast<std::uint32_t>(values_at + behind.size()));
        behind += entry.value;
      }
    }
    return out + base::to_raw_bytes(std::uint32_t{0}) + behind;
  }

 private:
  struct Entry {
    std::uint16_t tag, type;
    std::uint32_t count;
    std::string value;
  };
  void add(std::uint16_t tag, std::uint16_t type, std::uint32_t count, const std::string& value) {
    entries_.push_back({tag, type, count, value});
  }
  std::vector<Entry> entries_;
};

std::string segment(const std::string& content) {
  const auto length = static_cast<std::uint16_t>(content.size() + 2);
  return std::string("\xFF\xE1") + static_cast<char>(length >> 8) + static_cast<char>(length & 0xFF) + content;
}

/// EXIF of a photo taken on 2024-05-06 at `clock`, 45 deg 30' N, 9 deg 15' W, 120.5 m high.
std::string exif(const std::string& clock, const std::string& digits = "", const std::string& offset = "",
                 std::uint8_t height_reference = 0,
                 const std::vector<std::pair<std::uint16_t, std::uint32_t>>& lens = {}) {
  Directory gps, shot, first;
  gps.text(1, "N");
  gps.fractions(2, {{45, 1}, {30, 1}, {0, 1}});
  gps.text(3, "W");
  gps.fractions(4, {{9, 1}, {1475, 100}, {15, 1}});
  gps.byte(5, height_reference);
  gps.fractions(6, {{1205, 10}});
  shot.fractions(0x829A, {{1, 250}});
  shot.text(0x9003, "2024:05:06 " + clock);
  if (!offset.empty()) shot.text(0x9011, offset);
  if (!digits.empty()) shot.text(0x9291, digits);
  for (const auto& [tag, value] : lens) {
    if (tag == 0xA405) {
      shot.word(tag, static_cast<std::uint16_t>(value));
    } else {
      shot.fractions(tag, {{value, 100}});
    }
  }
  first.word(0x112, 6);
  Directory sized = first;  // as long as it will be
  sized.offset(0x8769, 0);
  sized.offset(0x8825, 0);
  const std::size_t shot_at = 8 + sized.size(), gps_at = shot_at + shot.size();
  first.offset(0x8769, static_cast<std::uint32_t>(shot_at));
  first.offset(0x8825, static_cast<std::uint32_t>(gps_at));
  return std::string("Exif\0\0", 6) + "II" + base::to_raw_bytes(std::uint16_t{42}) +
         base::to_raw_bytes(std::uint32_t{8}) + first.bytes(8) + shot.bytes(shot_at) + gps.bytes(gps_at);
}

std::string xmp(const std::string& attributes) {
  return std::string("http://ns.adobe.com/xap/1.0/\0", 29) +
         "<?xpacket begin='' id='W5M0MpCehiHzreSzNTczkc9d'?><x:xmpmeta xmlns:x='adobe:ns:meta/'>"
         "<rdf:RDF xmlns:rdf='http://www.w3.org/1999/02/22-rdf-syntax-ns#'><rdf:Description "
         "xmlns:drone-dji='http://www.dji.com/drone-dji/1.0/' " +
         attributes + "/></rdf:RDF></x:xmpmeta><?xpacket end='w'?>";
}

std::string jpeg(const std::vector<std::string>& contents) {
  std::string out = "\xFF\xD8";
  for (const std::string& content : contents) out += segment(content);
  return out + std::string("\xFF\xDA\x00\x02\xFF\xD9", 6);
}

PhotoTags tags_of(const std::string& bytes) { return read_photo_tags(std::as_bytes(std::span(bytes))); }

TEST(PhotoTags, OfExif) {
  const PhotoTags tags = tags_of(jpeg({exif("07:08:09", "25", "+02:00")}));
  EXPECT_DOUBLE_EQ(tags.latitude_deg.value(), 45.5);
  EXPECT_DOUBLE_EQ(tags.longitude_deg.value(), -(9 + 14.75 / 60 + 15.0 / 3600));
  EXPECT_DOUBLE_EQ(tags.absolute_height_m.value(), 120.5);
  EXPECT_EQ(tags.height_datum, HeightDatum::kMeanSeaLevel);
  EXPECT_DOUBLE_EQ(tags.exposure_s.value(), 0.004);
  EXPECT_EQ(tags.orientation, 6);
  EXPECT_DOUBLE_EQ(tags.taken_at_s.value(), 1714972089.25);  // date -u -d '2024-05-06T05:08:09' +%s
  EXPECT_DOUBLE_EQ(tags_of(jpeg({exif("07:08:09")})).taken_at_s.value(), 1714972089 + 7200) << "taken as UTC";
  EXPECT_DOUBLE_EQ(tags_of(jpeg({exif("07:08:09", "", "", 1)})).absolute_height_m.value(), -120.5);
  EXPECT_EQ(tags_of(jpeg({exif("07:08:09", "", "", 2)})).height_datum, HeightDatum::kEllipsoid);
}

TEST(PhotoTags, OfDjisXmpAsAttributesOrElements) {
  const PhotoTags tags =
      tags_of(jpeg({exif("07:08:09"), xmp("drone-dji:AbsoluteAltitude='+198.51' drone-dji:RelativeAltitude='+40.00' "
                                          "drone-dji:GimbalYawDegree='-45.30' drone-dji:GimbalPitchDegree='-90.00' "
                                          "drone-dji:GimbalRollDegree='junk' drone-dji:FlightYawDegree='+45.60' "
                                          "drone-dji:FlightPitchDegree='-1.90' drone-dji:FlightRollDegree='+2.30' "
                                          "drone-dji:AltitudeType='RtkAlt'")}));
  EXPECT_EQ(tags.absolute_height_m, 198.51);
  EXPECT_EQ(tags.height_datum, HeightDatum::kEllipsoid);
  EXPECT_EQ(tags.height_above_takeoff_m, 40.0);
  EXPECT_EQ(tags.gimbal_yaw_deg, -45.3);
  EXPECT_EQ(tags.gimbal_pitch_deg, -90.0);
  EXPECT_EQ(tags.gimbal_roll_deg, std::nullopt);
  EXPECT_EQ(tags.body_yaw_deg, 45.6);
  EXPECT_EQ(tags.body_pitch_deg, -1.9);
  EXPECT_EQ(tags.body_roll_deg, 2.3);
  std::string elements = xmp("a='b'");
  elements.replace(elements.find("/></rdf:RDF>"), 2,
                   "><drone-dji:RelativeAltitude>+12.5</drone-dji:RelativeAltitude></rdf:Description>");
  EXPECT_EQ(tags_of(jpeg({elements})).height_above_takeoff_m, 12.5);
}

std::string dji(const std::string& attributes) { return jpeg({exif("07:08:09"), xmp(attributes)}); }

TEST(PhotoTags, OfAnRtkReceiver) {
  const std::string sigmas =
      "drone-dji:RtkStdLon='0.01053' drone-dji:RtkStdLat='0.01380' drone-dji:RtkStdHgt='0.0205' ";
  const PhotoTags fixed = tags_of(dji(sigmas + "drone-dji:RtkFlag='50'"));
  EXPECT_EQ(fixed.rtk_solution, RtkSolution::kFixed);
  EXPECT_EQ(fixed.longitude_sigma_m, 0.01053);
  EXPECT_EQ(fixed.latitude_sigma_m, 0.0138);
  EXPECT_EQ(fixed.height_sigma_m, 0.0205);
  EXPECT_EQ(tags_of(dji("drone-dji:RtkFlag='34'")).rtk_solution, RtkSolution::kFloat);
  EXPECT_EQ(tags_of(dji("drone-dji:RtkFlag='48'")).rtk_solution, RtkSolution::kFloat);
  EXPECT_EQ(tags_of(dji("drone-dji:RtkFlag='16'")).rtk_solution, RtkSolution::kSingle);
  const PhotoTags none = tags_of(dji(sigmas + "drone-dji:RtkFlag='0'"));
  EXPECT_EQ(none.rtk_solution, RtkSolution::kNone);
  EXPECT_EQ(none.latitude_sigma_m, std::nullopt) << "of an earlier solution";
  const PhotoTags wrong =
      tags_of(dji("drone-dji:RtkFlag='50' drone-dji:RtkStdLon='0' drone-dji:RtkStdLat='-1' drone-dji:RtkStdHgt='nan'"));
  EXPECT_EQ(wrong.longitude_sigma_m, std::nullopt);
  EXPECT_EQ(wrong.latitude_sigma_m, std::nullopt);
  EXPECT_EQ(wrong.height_sigma_m, std::nullopt);
  EXPECT_EQ(tags_of(dji(sigmas)).latitude_sigma_m, std::nullopt) << "no RtkFlag says that there was a solution";
}

/// EXIF says "sea level" in all of them, as DJI's cameras do.
TEST(PhotoTags, WhatDjisHeightsAreAbove) {
  const auto datum = [](const std::string& attributes) {
    const PhotoTags tags = tags_of(dji("drone-dji:AbsoluteAltitude='+349.58' " + attributes));
    return std::pair(tags.height_datum, tags.states_height_datum);
  };
  EXPECT_EQ(datum("drone-dji:RtkFlag='50'"), std::pair(HeightDatum::kEllipsoid, false));
  EXPECT_EQ(datum("drone-dji:RtkFlag='16'"), std::pair(HeightDatum::kEllipsoid, false));
  EXPECT_EQ(datum("drone-dji:AltitudeType='RtkAlt' drone-dji:RtkFlag='50'"), std::pair(HeightDatum::kEllipsoid, true));
  EXPECT_EQ(datum("drone-dji:AltitudeType='RtkAlt'"), std::pair(HeightDatum::kEllipsoid, false));
  EXPECT_EQ(datum("drone-dji:AltitudeType='GpsFusionAlt'"), std::pair(HeightDatum::kEllipsoid, false));
  EXPECT_EQ(datum("drone-dji:AltitudeType='PressAlt' drone-dji:RtkFlag='50'").first, HeightDatum::kUnknown);
  EXPECT_EQ(datum("drone-dji:RtkFlag='0'").first, HeightDatum::kUnknown);
  EXPECT_EQ(datum("").first, HeightDatum::kUnknown);
}

/// senseFly's cameras state both heights; the geoid lies 33 m below the ellipsoid in Ohio.
TEST(PhotoTags, OfSenseFlysHeights) {
  std::string elements = xmp("a='b'");
  elements.replace(elements.find("/></rdf:RDF>"), 2,
                   "><sensefly:AltitudeAMSL xmlns:sensefly='x'>313.98</sensefly:AltitudeAMSL><sensefly:AltitudeWGS84 "
                   "xmlns:sensefly='x'>281.69</sensefly:AltitudeWGS84></rdf:Description>");
  const PhotoTags tags = tags_of(jpeg({exif("07:08:09"), elements}));
  EXPECT_EQ(tags.absolute_height_m, 281.69);
  EXPECT_EQ(tags.height_datum, HeightDatum::kEllipsoid);
  EXPECT_TRUE(tags.states_height_datum);
}

TEST(PhotoTags, OfTheLens) {
  const PhotoLensTags lens =
      tags_of(dji("drone-dji:DewarpData='2022-03-02;1973.09,1955.65,-19.04,-11.42,-0.42,0.37,0.0041,0.0042,-0.26' "
                  "drone-dji:DewarpFlag='0' drone-dji:CalibratedFocalLength='1913.333374' "
                  "drone-dji:CalibratedOpticalCenterX='800.0' drone-dji:CalibratedOpticalCenterY='650.0'"))
          .lens;
  EXPECT_THAT(lens.dewarp, ElementsAre(1973.09, 1955.65, -19.04, -11.42, -0.42, 0.37, 0.0041, 0.0042, -0.26));
  EXPECT_EQ(lens.dewarp_date, "2022-03-02");
  EXPECT_FALSE(lens.is_dewarped);
  EXPECT_EQ(lens.design_focal_px, 1913.333374);
  EXPECT_EQ(lens.design_centre_x_px, 800.0);
  EXPECT_EQ(lens.design_centre_y_px, 650.0);
  EXPECT_TRUE(tags_of(dji("drone-dji:DewarpFlag='1'")).lens.is_dewarped);
  EXPECT_THAT(tags_of(dji("drone-dji:DewarpData='1,2,3,4,5,6,7,8,9'")).lens.dewarp, SizeIs(9)) << "without a date";
  EXPECT_THAT(tags_of(dji("drone-dji:DewarpDataK6='d;1,2,3,4,5,6,7,8,9,10,11,12'")).lens.dewarp, SizeIs(12));
  for (const char* bad : {"", "d;", "d;1,2,3,4,5,6,7,8", "d;1,2,3,4,5,6,7,8,x", "1,2,3,4,5,6,7,8,9,10"})
    EXPECT_THAT(tags_of(dji("drone-dji:DewarpData='" + std::string(bad) + "'")).lens.dewarp, IsEmpty()) << bad;
  // A baseline frame header: length 11, 8 bits, 1300 rows, 1600 columns, one component (ITU-T T.81, B.2.2).
  const std::string frame("\xFF\xC0\x00\x0B\x08\x05\x14\x06\x40\x01\x01\x11\x00", 13);
  std::string bytes = jpeg({exif("07:08:09")});
  bytes.insert(bytes.rfind("\xFF\xDA"), frame);
  EXPECT_EQ(tags_of(bytes).lens.width, 1600);
  EXPECT_EQ(tags_of(bytes).lens.height, 1300);
}

TEST(PhotoTags, CutOrChangedAnywhereTheyAreReadOrLeftOut) {
  const std::string whole =
      jpeg({exif("07:08:09", "25"), xmp("drone-dji:RelativeAltitude='+40.00' drone-dji:RtkFlag='50' "
                                        "drone-dji:DewarpData='2022;1,2,3,4,5,6,7,8,9'")});
  for (std::size_t i = 0; i < whole.size(); ++i) {
    tags_of(whole.substr(0, i));
    std::string changed = whole;
    changed[i] = static_cast<char>(changed[i] ^ 0x5A);
    tags_of(changed);
  }
  EXPECT_EQ(tags_of("no picture").taken_at_s, std::nullopt);
}

class Photos : public testing::Test {
 protected:
  void add(const std::string& name, const std::string& bytes) { base::write_file(folder_ / name, bytes); }
  tests::TemporaryFolder folder_;
};

TEST_F(Photos, OfOneSecondAreSpreadOverIt) {
  add("c.JPG", jpeg({exif("07:08:11")}));
  add("a.jpg", jpeg({exif("07:08:09")}));
  add("b.jpeg", jpeg({exif("07:08:09")}));
  add("d.jpg", jpeg({}));
  add("notes.txt", "x");
  const PhotoLog log = read_photo_log(folder_.path());
  EXPECT_EQ(log.photos, 4U);
  ASSERT_EQ(log.times.size(), 3U);
  EXPECT_EQ(log.times.at("a.jpg").time_s, 0.0);
  EXPECT_EQ(log.times.at("b.jpeg").time_s, 0.5);
  EXPECT_EQ(log.times.at("c.JPG").time_s, 2.0);
  EXPECT_EQ(log.times.at("a.jpg").exposure_ms, 4.0);
  EXPECT_THAT(log.warnings,
              ElementsAre(HasSubstr("1 photos have the same time"), HasSubstr("3 photos have a rotation flag")));
  ASSERT_EQ(log.telemetry.fixes.size(), 3U);
  EXPECT_EQ(log.telemetry.fixes[1].time_s, 0.5);
  EXPECT_EQ(log.telemetry.height_datum, HeightDatum::kMeanSeaLevel);
  EXPECT_EQ(read_telemetry(folder_.path()).fixes.size(), 3U);
}

TEST_F(Photos, OfAnRtkReceiverHaveItsStandardDeviations) {
  const std::string rtk = "drone-dji:AbsoluteAltitude='+349.58' drone-dji:RtkStdLon='0.03' drone-dji:RtkStdLat='0.04' ";
  add("a.jpg", jpeg({exif("07:08:09"), xmp(rtk + "drone-dji:RtkStdHgt='0.06' drone-dji:RtkFlag='50'")}));
  add("b.jpg", jpeg({exif("07:08:12"), xmp(rtk + "drone-dji:RtkStdHgt='0.06' drone-dji:RtkFlag='50'")}));
  const Telemetry fixed = read_telemetry(folder_.path());
  ASSERT_EQ(fixed.fixes.size(), 2U);
  EXPECT_DOUBLE_EQ(fixed.fixes[0].horizontal_sigma_m.value(), 0.05 / std::sqrt(2.0));
  EXPECT_EQ(fixed.fixes[0].vertical_sigma_m, 0.06);
  EXPECT_EQ(fixed.height_datum, HeightDatum::kEllipsoid);
  EXPECT_THAT(fixed.height_datum_note, HasSubstr("as above the ellipsoid, because of DJI's tags"));
  EXPECT_THAT(fixed.warnings, IsEmpty());

  add("c.jpg", jpeg({exif("07:08:15"), xmp(rtk + "drone-dji:RtkFlag='34'")}));
  add("d.jpg", jpeg({exif("07:08:18"), xmp(rtk + "drone-dji:RelativeAltitude='+40.00' drone-dji:RtkFlag='0'")}));
  const Telemetry mixed = read_telemetry(folder_.path());
  ASSERT_EQ(mixed.fixes.size(), 4U);
  EXPECT_EQ(mixed.fixes[2].vertical_sigma_m, std::nullopt);
  EXPECT_EQ(mixed.fixes[3].absolute_height_m, std::nullopt) << "it is not known what it is above";
  EXPECT_EQ(mixed.fixes[3].horizontal_sigma_m, std::nullopt);
  EXPECT_THAT(mixed.warnings, ElementsAre(HasSubstr("1 of 4 photos state no height above the ellipsoid"),
                                          HasSubstr("2 of 4 photos have no fixed RTK solution (RtkFlag: 1 float, 0 "
                                                    "single, 1 none)"),
                                          HasSubstr("1 of 4 photos have an RTK solution but no standard deviations")));
}

TEST_F(Photos, OfDronesThatDoNotSayWhatTheirHeightIsAbove) {
  add("a.jpg", jpeg({exif("07:08:09"), xmp("drone-dji:AbsoluteAltitude='+198.51'")}));
  const Telemetry log = read_telemetry(folder_.path());
  EXPECT_EQ(log.height_datum, HeightDatum::kMeanSeaLevel);
  EXPECT_THAT(log.height_datum_note, HasSubstr("do not state what their heights are above"));
  base::write_file(folder_ / "a.jpg", jpeg({exif("07:08:09")}));
  EXPECT_EQ(read_telemetry(folder_.path()).height_datum_note, "") << "EXIF alone states sea level";
}

// FocalLength, DigitalZoomRatio and FocalLengthIn35mmFilm: CIPA DC-008, 4.6.5. The ratio 0 means that none was used.
TEST_F(Photos, SayHowTheyWereZoomed) {
  constexpr std::uint16_t kFocal = 0x920A, kDigital = 0xA404, kFilm = 0xA405;
  const auto warnings = [&](const std::string& name, std::uint32_t focal, std::uint32_t digital, std::uint32_t film) {
    add(name,
        jpeg({exif("07:08:1" + name.substr(0, 1), "", "", 0, {{kFocal, focal}, {kDigital, digital}, {kFilm, film}})}));
    return find_zoom_warnings(read_photo_log(folder_.path()).zooms, "the photos' tags");
  };
  EXPECT_THAT(warnings("1.jpg", 880, 0, 24), IsEmpty());
  EXPECT_THAT(warnings("2.jpg", 880, 0, 25), IsEmpty()) << "rounded";
  EXPECT_THAT(
      warnings("3.jpg", 880, 0, 48),
      ElementsAre(HasSubstr("focal length in 35 mm film changes by a factor of 2 (24 to 48) between 1.jpg and 3.jpg")));
  EXPECT_THAT(warnings("4.jpg", 1320, 200, 72),
              ElementsAre(HasSubstr("focal length changes by a factor of 1.5 (8.8 to 13.2) between 3.jpg and 4.jpg")));
}

// A Canon ELPH 300: 4.3 mm, 16393.44 pixels per inch of its sensor.
TEST_F(Photos, StateTheDensityOfTheSensorsPixels) {
  constexpr std::uint16_t kFocal = 0x920A, kPlane = 0xA20E;
  const PhotoTags tags = tags_of(jpeg({exif("07:08:09", "", "", 0, {{kFocal, 430}, {kPlane, 1639344}})}));
  EXPECT_NEAR(tags.lens.focal_plane_px.value(), 4.3 * 16393.44 / 25.4, 1e-6);
  EXPECT_FALSE(tags_of(jpeg({exif("07:08:09", "", "", 0, {{kFocal, 430}})})).lens.focal_plane_px);
}

TEST_F(Photos, WithoutTagsAreNoLog) {
  add("a.jpg", jpeg({}));
  EXPECT_THAT(read_photo_log(folder_.path()).times, IsEmpty());
  EXPECT_THAT(tests::refusal_of([&] { read_telemetry(folder_.path()); }), HasSubstr("none of its 1 JPEG photos"));
  EXPECT_THAT(tests::refusal_of([&] { read_photo_log(folder_ / "none"); }), HasSubstr("no such folder"));
}

/// Six photos of a real survey at 40 m (a Phantom 3 over a beach): the values that exif and strings print.
TEST(PhotosRealData, AreRead) {
  TILEFLIGHT_REQUIRE_TEST_DATA(folder, "drone_photos/brighton_beach_a/images");
  const PhotoLog log = read_photo_log(folder);
  ASSERT_EQ(log.times.size(), 6U);
  ASSERT_EQ(log.telemetry.fixes.size(), 6U);
  EXPECT_THAT(log.warnings, IsEmpty());
  EXPECT_NEAR(log.times.at("DJI_0022.JPG").exposure_ms, 1e3 / 285, 0.02);
  const TelemetryFix& first = log.telemetry.fixes.front();
  EXPECT_EQ(first.absolute_height_m, 198.51);
  EXPECT_EQ(first.height_above_takeoff_m, 40.0);
  EXPECT_EQ(first.gimbal_pitch_deg, -90.0);
  EXPECT_EQ(first.gimbal_yaw_deg, 45.3);
  EXPECT_EQ(first.body_roll_deg, 2.3);
  EXPECT_NEAR(first.latitude_deg, 46.84, 0.02);
  EXPECT_NEAR(first.longitude_deg, -91.99, 0.02);
  for (std::size_t i = 1; i < 6; ++i) {
    const double gap_s = log.telemetry.fixes[i].time_s - log.telemetry.fixes[i - 1].time_s;
    EXPECT_GE(gap_s, 4);
    EXPECT_LE(gap_s, 12);
  }
}

/// 32 photos of a survey drone with RTK, whose XMP another program reads by its text alone.
TEST(PhotosRealData, OfAnRtkSurveyAgreeWithAnotherReader) {
  TILEFLIGHT_REQUIRE_TEST_DATA(folder, "real/mirafiori");
  const PhotoLog log = read_photo_log(folder);
  ASSERT_EQ(log.telemetry.fixes.size(), 32U);
  EXPECT_EQ(log.telemetry.height_datum, HeightDatum::kEllipsoid);
  EXPECT_THAT(log.telemetry.warnings, IsEmpty());
  const tests::ProgramResult other = tests::run_command(
      {"python3", "-c",
       "import re, sys, pathlib\n"
       "for file in sorted(pathlib.Path(sys.argv[1]).glob('*.JPG')):\n"
       "    tags = dict(re.findall(rb'drone-dji:(\\w+)=\"([^\"]*)\"', file.read_bytes()))\n"
       "    names = [b'RtkFlag', b'GpsLatitude', b'GpsLongitude', b'AbsoluteAltitude', b'RtkStdLat', b'RtkStdLon',\n"
       "             b'RtkStdHgt', b'CalibratedFocalLength']\n"
       "    dewarp = tags[b'DewarpData'].split(b';')[1].replace(b',', b' ')\n"
       "    print(file.name, *[float(tags[name]) for name in names], dewarp.decode())\n",
       folder.string()});
  ASSERT_EQ(other.exit_code, 0) << other.err;
  std::istringstream lines(other.out);
  std::string name;
  std::size_t photos = 0;
  while (lines >> name) {
    double flag = 0, latitude_deg = 0, longitude_deg = 0, height_m = 0, north_m = 0, east_m = 0, up_m = 0,
           design_px = 0;
    lines >> flag >> latitude_deg >> longitude_deg >> height_m >> north_m >> east_m >> up_m >> design_px;
    std::vector<double> dewarp(9);
    for (double& number : dewarp) lines >> number;
    EXPECT_EQ(flag, 50);
    const auto fix = std::ranges::find_if(
        log.telemetry.fixes, [&](const TelemetryFix& one) { return one.time_s == log.times.at(name).time_s; });
    ASSERT_NE(fix, log.telemetry.fixes.end()) << name;
    EXPECT_NEAR(fix->latitude_deg, latitude_deg, 4e-8) << name;
    EXPECT_NEAR(fix->longitude_deg, longitude_deg, 4e-8);
    EXPECT_EQ(fix->absolute_height_m, height_m);
    EXPECT_NEAR(fix->horizontal_sigma_m.value(), std::sqrt((north_m * north_m + east_m * east_m) / 2), 1e-12);
    EXPECT_LT(fix->horizontal_sigma_m.value(), 0.02);
    EXPECT_EQ(fix->vertical_sigma_m, up_m);
    const PhotoLensTags& lens = log.lenses.at(photos++).second;
    EXPECT_EQ(lens.dewarp, dewarp);
    EXPECT_EQ(lens.design_focal_px, design_px);
    EXPECT_EQ(lens.width, 1600);
    EXPECT_EQ(lens.taken_height, 1300);
    EXPECT_EQ(lens.model, "FC6360");
  }
  EXPECT_EQ(photos, 32U);
}

}  // namespace
}  // namespace tileflight::flight_logs::photo_log_test
