#include <gmock/gmock.h>

#include <fstream>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/data/flight_logs/telemetry.h"
#include "tileflight/data/flight_logs/test_log.h"

namespace tileflight::flight_logs::gpx_test {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::ThrowsMessage;

const char* const kHead = R"(<?xml version="1.0" encoding="UTF-8"?>
<gpx version="1.1" creator="hand" xmlns="http://www.topografix.com/GPX/1/1">)";

std::string point(const std::string& latitude, const std::string& time, const std::string& more = "") {
  return "<trkpt lat=\"" + latitude + "\" lon=\"-78.5\"><ele>2900.5</ele><time>" + time + "</time>" + more +
         "</trkpt>\n";
}

std::string track(const std::string& points) { return kHead + ("<trk><trkseg>" + points + "</trkseg></trk></gpx>\n"); }

class Gpx : public LogTest {
 protected:
  Gpx() : LogTest("log.gpx", read_gpx) {}
};

TEST_F(Gpx, PointsOfAllSegmentsWithTimesOfAnyOffset) {
  const Telemetry log = read(track(point("-0.25", "2024-02-28T23:59:59.5Z") + point("-0.26", "2024-02-29T00:00:01Z") +
                                   "</trkseg></trk><trk><trkseg>" + point("-0.27", "2024-02-29T02:00:02.125+02:00") +
                                   point("-0.28", "2024-02-28T18:30:03-0530") + point("-0.29", "2024-02-29T00:00:04")));
  ASSERT_EQ(log.fixes.size(), 5u);
  const double times_s[] = {0.0, 1.5, 2.625, 3.5, 4.5};
  for (std::size_t i = 0; i < 5; ++i) {
    EXPECT_NEAR(log.fixes[i].time_s, times_s[i], 1e-6);
    EXPECT_NEAR(log.fixes[i].latitude_deg, -0.25 - 0.01 * static_cast<double>(i), 1e-12);
    EXPECT_EQ(log.fixes[i].longitude_deg, -78.5);
    EXPECT_EQ(log.fixes[i].absolute_height_m, 2900.5);
  }
  EXPECT_EQ(log.zero_utc_s, base::parse_iso_time_s("2024-02-28T23:59:59.5Z"));
  EXPECT_EQ(log.height_datum, HeightDatum::kMeanSeaLevel);
  EXPECT_THAT(log.warnings, IsEmpty());
}

/// Converters that do not know the heights write 0 for each point.
TEST_F(Gpx, HeightsThatAreAllZeroWereNotRecorded) {
  const auto at_zero = [](const std::string& latitude, const std::string& time) {
    return "<trkpt lat=\"" + latitude + "\" lon=\"14.5\"><ele>0</ele><time>" + time + "</time></trkpt>\n";
  };
  const Telemetry log = read(track(at_zero("45.1", "2024-01-01T00:00:01Z") + at_zero("45.2", "2024-01-01T00:00:02Z")));
  ASSERT_EQ(log.fixes.size(), 2u);
  EXPECT_EQ(log.fixes[1].absolute_height_m, std::nullopt);
  EXPECT_THAT(log.warnings, ElementsAre("the absolute height is 0 in every entry and is treated as not recorded"));
}

/// Programs that have lost the times write one and the same for each point.
TEST_F(Gpx, PointsOfOneTimeAreRefused) {
  std::string points;
  for (int i = 0; i < 5; ++i) points += point("45." + std::to_string(i), "1901-12-13T20:45:52Z");
  EXPECT_THAT([&] { read(track(points)); },
              ThrowsMessage<InputError>(HasSubstr("none of its 5 track points is later than the first")));
}

TEST_F(Gpx, TracksWithTheNewestFirstAreSorted) {
  const Telemetry log = read(track(point("45.3", "2024-01-01T00:00:03Z") + point("45.4", "2024-01-01T00:00:04Z") +
                                   "</trkseg></trk><trk><trkseg>" + point("45.2", "2024-01-01T00:00:02Z") +
                                   point("45.1", "2024-01-01T00:00:01Z")));
  ASSERT_EQ(log.fixes.size(), 4u);
  for (std::size_t i = 0; i < 4; ++i) EXPECT_NEAR(log.fixes[i].latitude_deg, 45.1 + 0.1 * static_cast<double>(i), 1e-9);
  EXPECT_THAT(log.warnings, ElementsAre("the tracks were not in order of time and have been sorted"));
}

TEST_F(Gpx, OlderVersionWithPrefixAndSpaces) {
  const Telemetry log = read(
      "\xEF\xBB\xBF<x:gpx version='1.0' xmlns:x='http://www.topografix.com/GPX/1/0'>\r\n<x:trk><x:trkseg>"
      "<x:trkpt lon=' 10.5 ' lat='45'>\r\n<x:time>\r\n 2024-05-06T07:08:09Z \r\n</x:time></x:trkpt>"
      "</x:trkseg></x:trk></x:gpx>");
  ASSERT_EQ(log.fixes.size(), 1u);
  EXPECT_EQ(log.fixes[0].longitude_deg, 10.5);
  EXPECT_EQ(log.fixes[0].absolute_height_m, std::nullopt);
}

TEST_F(Gpx, ExtensionsRoutesAndWaypointsAreNoTrack) {
  const Telemetry log = read(kHead + ("<wpt lat='1' lon='1'><time>2020-01-01T00:00:00Z</time></wpt><trk><trkseg>" +
                                      point("45", "2024-01-01T00:00:00Z",
                                            "<extensions><a><ele>7</ele><time>1999-01-01T00:00:00Z</time></a>"
                                            "</extensions>") +
                                      "</trkseg></trk></gpx>"));
  ASSERT_EQ(log.fixes.size(), 1u);
  EXPECT_EQ(log.fixes[0].absolute_height_m, 2900.5);
}

TEST_F(Gpx, UnusablePointsAreDroppedAndCounted) {
  const std::string no_height = "<trkpt lat='45' lon='9'><time>2024-01-01T00:00:09Z</time></trkpt>";
  const Telemetry log = read(track(point("0.5", "2024-01-01T00:00:00Z") + point("45", "yesterday") +
                                   point("north", "2024-01-01T00:00:01Z") + point("45", "2024-01-01T00:00:02Z") +
                                   point("45.1", "2024-01-01T00:00:01Z") + point("91", "2024-01-01T00:00:04Z") +
                                   point("45", "2024-02-30T00:00:02Z") + no_height));
  ASSERT_EQ(log.fixes.size(), 2u);
  EXPECT_EQ(log.fixes[1].time_s, 2.0);
  EXPECT_THAT(log.warnings, ElementsAre("2 entries dropped: no time", "1 entries dropped: no position fix",
                                        "1 entries dropped: latitude or longitude out of range",
                                        "1 entries dropped: time does not increase", "1 entries dropped: no height"));
}

TEST_F(Gpx, UnusableFilesAreOneClearLine) {
  EXPECT_THAT(fault(""), HasSubstr("log.gpx: contains no track points"));
  EXPECT_THAT(fault("<kml/>"), HasSubstr("is XML but not GPX: its root element is <kml>"));
  EXPECT_THAT(fault(track("<trkpt lat='45' lon='9'><ele>1</ele></trkpt>")),
              HasSubstr("none of its 1 track points has a time and a position (1 entries dropped: no time)"));
  EXPECT_THAT([&] { read_gpx(folder_ / "absent.gpx"); },
              ThrowsMessage<InputError>(HasSubstr("absent.gpx: cannot be opened")));
}

TEST_F(Gpx, EntitiesAndTypesAreRefused) {
  EXPECT_THAT(fault("<?xml version='1.0'?>\n<!DOCTYPE gpx [<!ENTITY a 'aaaa'><!ENTITY b '&a;&a;&a;'>]><gpx>&b;</gpx>"),
              HasSubstr("line 2: document types are not supported"));
  EXPECT_THAT(fault("<!DOCTYPE gpx SYSTEM 'file:///etc/passwd'><gpx/>"), HasSubstr("document types are not supported"));
  EXPECT_THAT(fault(track("<trkpt lat='&x;' lon='9'/>")), HasSubstr("contains no track points"));
}

TEST_F(Gpx, DeepNestingAndLongTextAreBounded) {
  std::string deep;
  for (int i = 0; i < 100000; ++i) deep += "<a>";
  const Telemetry log = read(track(point("45", "2024-01-01T00:00:00Z") + deep));
  EXPECT_EQ(log.fixes.size(), 1u);
  ASSERT_EQ(log.warnings.size(), 1u);
  EXPECT_THAT(log.warnings[0], HasSubstr("elements are nested deeper than 64"));
  EXPECT_EQ(
      read(track(point("45", "2024-01-01T00:00:00Z", "<name>" + std::string(1 << 20, 'x') + "</name>"))).fixes.size(),
      1u);
}

TEST_F(Gpx, CutAtEveryByteGivesTheWholePointsBefore) {
  const std::string whole = track(point("45.1", "2024-01-01T00:00:00Z") + point("45.2", "2024-01-01T00:00:01Z"));
  const std::size_t first_end = whole.find("</trkpt>") + 8, second_end = whole.rfind("</trkpt>") + 8;
  for (std::size_t bytes = 0; bytes < whole.size() - 1; ++bytes) {
    const std::string text = whole.substr(0, bytes);
    if (bytes < first_end) {
      EXPECT_NE(fault(text), "no error") << bytes;
      continue;
    }
    const Telemetry log = read(text);
    EXPECT_EQ(log.fixes.size(), bytes < second_end ? 1u : 2u) << bytes;
    ASSERT_EQ(log.warnings.size(), bytes < whole.rfind("</gpx>") + 6 ? 1u : 0u) << bytes;
  }
}

TEST_F(Gpx, IsKnownByItsContent) {
  const std::string text = track(point("45", "2024-01-01T00:00:00Z"));
  for (const char* name : {"log.srt", "log", "log.GPX"}) {
    std::ofstream(folder_ / name, std::ios::binary) << "\n " << text.substr(text.find("<gpx"));
    EXPECT_EQ(read_telemetry(folder_ / name).height_datum, HeightDatum::kMeanSeaLevel) << name;
  }
}

}  // namespace
}  // namespace tileflight::flight_logs::gpx_test

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

// OGC 12-007r2, 9.12: the altitudeMode of a MultiTrack is that of its tracks.
TEST_F(Kml, TheAltitudeModeOfAMultiTrackIsThatOfItsTracks) {
  const std::string bare = "<gx:Track>" + std::string(kPoints) + "</gx:Track>";
  const Telemetry log =
      read(document("<gx:MultiTrack><altitudeMode>absolute</altitudeMode>" + bare + "</gx:MultiTrack>"));
  ASSERT_EQ(log.fixes.size(), 2u);
  EXPECT_EQ(log.fixes[0].absolute_height_m, 2900.5);
  EXPECT_THAT(log.warnings, IsEmpty());
  EXPECT_EQ(read(document(bare)).fixes.front().absolute_height_m, std::nullopt);
}

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

TEST_F(Kml, PlacemarksWithATimeAreRead) {
  const auto placemark = [](const std::string& time, const std::string& place) {
    return "<Placemark><TimeStamp><when>" + time + "</when></TimeStamp><Point><altitudeMode>absolute</altitudeMode>" +
           "<coordinates>" + place + "</coordinates></Point></Placemark>";
  };
  const Telemetry log =
      read(document("<Placemark><LineString><coordinates>-78.5,-0.25,2900</coordinates></LineString>"
                    "</Placemark>" +
                    placemark("2024-01-01T00:00:00Z", "-78.5,-0.25,2900.5") +
                    placemark("2024-01-01T00:00:02Z", " -78.6,-0.26,2901 ")));
  ASSERT_EQ(log.fixes.size(), 2u);
  EXPECT_NEAR(log.fixes[1].time_s, 2.0, 1e-6);
  EXPECT_EQ(log.fixes[1].longitude_deg, -78.6);
  EXPECT_EQ(log.fixes[0].absolute_height_m, 2900.5);
}

TEST_F(Kml, ALineWithoutTimesIsNamedWithTheWayToConvertIt) {
  EXPECT_THAT(fault(document("<Placemark><LineString><coordinates>-78.5,-0.25,2900 -78.6,-0.26,2901</coordinates>"
                             "</LineString></Placemark>")),
              HasSubstr("has a LineString, whose positions have no times: export the flight as GPX"));
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
