#include "tileflight/data/messages/cdr.h"

#include <gmock/gmock.h>

#include "tests/refusal.h"

namespace tileflight::messages::cdr_reader_test {
namespace {

using tests::refusal_of;

TEST(CdrReader, ReadsWhatTheWriterWrote) {
  const std::string cdr =
      CdrWriter().number(std::uint8_t{7}).number(-1.5).text("map").number(std::uint16_t{9}).text("").bytes();
  CdrReader reader(cdr, "message");
  EXPECT_EQ(reader.number<std::uint8_t>(), 7);
  EXPECT_EQ(reader.number<double>(), -1.5);
  EXPECT_EQ(reader.text(3), "map");
  EXPECT_EQ(reader.number<std::uint16_t>(), 9);
  EXPECT_EQ(reader.text(0), "");
  EXPECT_EQ(refusal_of([&] { reader.number<std::uint8_t>(); }),
            "message: a message is cut off (byte " + std::to_string(cdr.size()) + ")");
}

/// OMG's CDR_BE: the same alignment, the bytes of each number reversed.
TEST(CdrReader, ReadsTheOtherByteOrder) {
  const std::string cdr("\0\0\0\0\x07\0\0\0\0\0\x01\x02\0\0\0\x02z\0", 18);
  CdrReader reader(cdr, "message");
  EXPECT_EQ(reader.number<std::uint8_t>(), 7);
  EXPECT_EQ(reader.number<std::uint32_t>(), 0x102U);
  EXPECT_EQ(reader.text(10), "z");
}

TEST(CdrReader, RefusesLengthsThatLie) {
  const std::string cdr("\0\1\0\0\xFF\xFF\xFF\xFFz\0", 10);
  const auto text_refusal = [&](std::size_t max_bytes) {
    return refusal_of([&] { CdrReader(cdr, "message").text(max_bytes); });
  };
  EXPECT_EQ(text_refusal(0xFFFFFFFE), "message: a message is cut off (byte 8)");
  EXPECT_EQ(text_refusal(10), "message: a message holds a text of 4294967295 bytes (byte 8)");
  for (const std::string_view header : {std::string_view("\0\1\0", 3), std::string_view("\0\3\0\0", 4)})
    EXPECT_EQ(refusal_of([&] { CdrReader(header, "message"); }), "message: a message is not encoded in CDR")
        << "cut off, then a parameter list";
}

}  // namespace
}  // namespace tileflight::messages::cdr_reader_test
