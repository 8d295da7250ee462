#include "tileflight/core/base/file_kind.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tileflight/core/base/text_parsing.h"

namespace tileflight::base::file_kind_test {
namespace {

using namespace std::string_literals;
using testing::HasSubstr;

TEST(FileKind, FilesAreRecognizedByTheirContent) {
  const std::vector<std::pair<std::string, std::string>> files{
      {"\0\0\0\x20"
       "ftypisom\0\0\2\0"s,
       "is a video (MP4 or MOV), not a flight log: give it as the video"},
      {"\0\0\0\x20"
       "ftypheic"s,
       "is a HEIF photo"},
      {"#ROSBAG V2.0\nrest", "is a ROS 1 bag, not a flight log: extract its topics"},
      {"SQLite format 3\0"s, "is a SQLite database"},
      {"PK\3\4....", "is a ZIP archive, not a flight log: unpack it first (a .kmz holds doc.kml)"},
      {"PK\3\4\x14\0\6\0\10\0\0\0!\0\0\0\0\0\0\0\0\0\0\0\0\0\x13\0\0\0[Content_Types].xml"s, "is a spreadsheet"},
      {"\x0E\x10\xD9\x07\0\0\0\0.FIT"s, "gpsbabel -i garmin_fit"},
      {"H Product:Blackbox flight data recorder\nH Data version:2\n", "--imu"},
      {"AXXX001\r\nHFDTE160701\r\n", "gpsbabel -i igc"},
      {"<!DOCTYPE html><html>", "is a web page"},
      {"version https://git-lfs.github.com/spec/v1\n", "git lfs pull"},
      {"\xFF\xFE"
       "t\0i\0"s,
       "is text in UTF-16, not a flight log: convert it: iconv -f UTF-16 -t UTF-8 FILE > NEW, or save it as UTF-8"},
      {"\1\2\3\4\0\0\0"s, "is a binary file of an unknown kind"}};
  for (const auto& [head, message] : files)
    EXPECT_THAT(refusal_of_kind(head, "a flight log").value_or("nothing"), HasSubstr(message)) << head;
}

TEST(FileKind, TextThatMayBeAnythingIsNot) {
  for (const std::string& head :
       {"time,lat,lon\n0,47,8\n"s, "\xEF\xBB\xBF"s + "t,x\n", "{\"a\": 1}"s, "<gpx/>"s, ""s, "gr\xFC\xDF"s})
    EXPECT_FALSE(recognize_file(head)) << head;
}

TEST(NaturalOrder, NumbersAreOrderedByValue) {
  const std::vector<std::string> ordered{"a",
                                         "a1",
                                         "a1.25.png",
                                         "a1.5.png",
                                         "a2",
                                         "a10",
                                         "b001",
                                         "b01",
                                         "b1",
                                         "b2",
                                         "frame_1",
                                         "frame_2",
                                         "frame_10",
                                         "frame_10b",
                                         "frame_11",
                                         "x99999999999999999998",
                                         "x99999999999999999999"};
  for (std::size_t i = 0; i < ordered.size(); ++i)
    for (std::size_t j = 0; j < ordered.size(); ++j)
      EXPECT_EQ(natural_less(ordered[i], ordered[j]), i < j) << ordered[i] << " and " << ordered[j];
}

}  // namespace
}  // namespace tileflight::base::file_kind_test
