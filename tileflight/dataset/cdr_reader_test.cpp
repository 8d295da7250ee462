#include "tileflight/dataset/cdr_reader.h"

#include <gmock/gmock.h>

#include "tileflight/base/input_error.h"
#include "tileflight/dataset/cdr.h"

namespace tileflight::dataset::cdr_reader_test {
namespace {

TEST(CdrReader, ReadsWhatTheWriterWrote) {
  const std::string cdr =
      CdrWriter().number(std::uint8_t{7}).number(-1.5).text("map").number(std::uint16_t{9}).text("").bytes();
  CdrReader reader(cdr, "message");
  EXPECT_EQ(reader.number<std::uint8_t>(), 7);
  EXPECT_EQ(reader.number<double>(), -1.5);
  EXPECT_EQ(reader.text(3), "map");
  EXPECT_EQ(reader.number<std::uint16_t>(), 9);
  EXPECT_EQ(reader.text(0), "");
  EXPECT_THROW(reader.number<std::uint8_t>(), InputError);
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
  EXPECT_THROW(CdrReader(cdr, "message").text(0xFFFFFFFE), InputError);
  EXPECT_THROW(CdrReader(cdr, "message").text(10), InputError);
  EXPECT_THROW(CdrReader(std::string_view("\0\1\0", 3), "message"), InputError);
  EXPECT_THROW(CdrReader(std::string_view("\0\3\0\0", 4), "message"), InputError) << "a parameter list";
}

}  // namespace
}  // namespace tileflight::dataset::cdr_reader_test
