#include "tileflight/data/flight_logs/kml.h"

#include <gmock/gmock.h>

#include "tileflight/core/base/text_parsing.h"
#include "tileflight/data/flight_logs/telemetry_file.h"
#include "tileflight/data/flight_logs/test_log.h"

namespace tileflight::flight_logs::kml_test {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;

std::string document(const std::string& tracks) {
  return "<?xml version='1.0'?><kml xmlns='http://www.opengis.net/kml/2.2' "
         "xmlns:gx='http://www.google.com/kml/ext/2.2'><Document><Placemark>" +
         tracks + "</Placemark></Document></kml>";
}

std::string track(const std::string& points, const std::string& mode = "absolute") {
  return "<gx:Track><altitudeMode>" + mode + "</altitudeMode>" + points + "</gx:Track>";
}

const char* const kPoints =
    "<when>2024-01-01T00:00:00Z</when><when>2024-01-01T00:00:01.5Z</when>"
    "<gx:coord>-78.5 -0.25 2900.5</gx:coord>\n<gx:coord> -78.6 -0.26 2901 </gx:coord>";

class Kml : public LogTest {
 protected:
  Kml() : LogTest("log.kml", read_telemetry) {}
};

TEST_F(Kml, TimesAndPlacesBelongTogetherByTheirOrder) {
  const Telemetry log = read(document(track(kPoints)));
  ASSERT_EQ(log.fixes.size(), 2u);
  EXPECT_NEAR(log.fixes[1].time_s, 1.5, 1e-6);
  EXPECT_EQ(log.zero_utc_s, base::parse_iso_time_s("2024-01-01T00:00:00Z"));
  EXPECT_EQ(log.fixes[1].latitude_deg, -0.26);
  EXPECT_EQ(log.fixes[1].longitude_deg, -78.6);
  EXPECT_EQ(log.fixes[0].absolute_height_m, 2900.5);
  EXPECT_EQ(log.height_datum, HeightDatum::kMeanSeaLevel);
  EXPECT_THAT(log.warnings, IsEmpty());
}

TEST_F(Kml, HeightsAboveTheGroundAreNotRead) {
  const Telemetry log = read(document(track(kPoints, "relativeToGround")));
  ASSERT_EQ(log.fixes.size(), 2u);
  EXPECT_EQ(log.fixes[0].absolute_height_m, std::nullopt);
  ASSERT_EQ(log.warnings.size(), 1u);
  EXPECT_THAT(log.warnings[0], HasSubstr("altitudeMode is not 'absolute'"));
}

TEST_F(Kml, UnusableFilesAreOneClearLine) {
  EXPECT_THAT(fault(document("")), HasSubstr("log.kml: contains no points of a gx:Track"));
  EXPECT_THAT(fault(document(track("<gx:coord>1 2 3</gx:coord>"))), HasSubstr("no time"));
  EXPECT_THAT(fault(document(track("<when>2024-01-01T00:00:00Z</when><gx:coord/>"))), HasSubstr("no position fix"));
  EXPECT_THAT(fault("<!DOCTYPE kml><kml/>"), HasSubstr("document types are not supported"));
}

TEST_F(Kml, CutAtEveryByteGivesTheWholeTracksBefore) {
  const std::string whole = document(track(kPoints));
  const std::size_t end = whole.find("</gx:Track>") + 11;
  for (std::size_t bytes = 0; bytes < whole.size(); ++bytes) {
    const std::string text = whole.substr(0, bytes);
    if (bytes < end) {
      EXPECT_NE(fault(text), "no error") << bytes;
    } else {
      EXPECT_EQ(read(text).fixes.size(), 2u) << bytes;
      EXPECT_EQ(read(text).warnings.size(), 1u) << bytes;
    }
  }
}

}  // namespace
}  // namespace tileflight::flight_logs::kml_test
