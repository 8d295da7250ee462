#include "tileflight/live/rpc/codec.h"

#include <gmock/gmock.h>

#include <cmath>

namespace tileflight::rpc {

struct Inner {
  float x_val = 1.0F, y_val = 2.0F;
};
struct Outer {
  Inner inner;
  std::string name = "none";
  std::vector<std::uint8_t> data;
  std::vector<float> reals;
  std::vector<int> numbers;
  std::array<std::array<float, 2>, 2> matrix{};
  bool flag = false;
  double precise = 0.0;
  std::uint64_t time = 0;
};
TILEFLIGHT_RPC_FIELDS(Inner, x_val, y_val);
TILEFLIGHT_RPC_FIELDS(Outer, inner, name, data, reals, numbers, matrix, flag, precise, time);

namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;

template <class T>
std::string encoded(const T& value) {
  Encoder out;
  encode(out, value);
  return out.take();
}

template <class T>
T decoded(const std::string& bytes) {
  const msgpack::object_handle handle = msgpack::unpack(bytes.data(), bytes.size());
  T value{};
  decode(handle.get(), value);
  return value;
}

std::string bytes(std::initializer_list<int> values) {
  std::string result;
  for (const int value : values) result += static_cast<char>(value);
  return result;
}

TEST(Encoder, WritesTheBytesOfTheSpecification) {
  EXPECT_EQ(encoded(true), bytes({0xc3}));
  EXPECT_EQ(encoded(1), bytes({0x01}));
  EXPECT_EQ(encoded(-1), bytes({0xff}));
  EXPECT_EQ(encoded(std::uint64_t{1} << 40U), bytes({0xcf, 0, 0, 1, 0, 0, 0, 0, 0}));
  EXPECT_EQ(encoded(1.0F), bytes({0xca, 0x3f, 0x80, 0, 0}));
  EXPECT_EQ(encoded(1.0), bytes({0xcb, 0x3f, 0xf0, 0, 0, 0, 0, 0, 0}));
  EXPECT_EQ(encoded(Inner{1.0F, -2.0F}), bytes({0x82, 0xa5}) + "x_val" + bytes({0xca, 0x3f, 0x80, 0, 0, 0xa5}) +
                                             "y_val" + bytes({0xca, 0xc0, 0, 0, 0}));
  EXPECT_EQ(encoded(std::vector<std::uint8_t>{1, 2, 255}), bytes({0xc4, 3, 1, 2, 255}));
  EXPECT_EQ(encoded(std::vector<float>{1.0F, 0.5F}), bytes({0x92, 0xca, 0x3f, 0x80, 0, 0, 0xca, 0x3f, 0, 0, 0}));
  EXPECT_EQ(encoded(std::vector<std::string>{"a", ""}), bytes({0x92, 0xa1, 'a', 0xa0}));
}

TEST(Encoder, NeverWritesStr8) {
  for (const int length : {0, 31, 32, 200, 255, 256, 65535, 65536}) {
    const std::string text(static_cast<std::size_t>(length), 'a');
    const std::string packed = encoded(text);
    EXPECT_NE(packed[0], '\xd9') << length;
    EXPECT_EQ(decoded<std::string>(packed), text);
  }
  EXPECT_EQ(encoded(std::string(32, 'a')).substr(0, 3), bytes({0xda, 0, 32}));
}

TEST(Encoder, WritesOnlyUtf8) {
  EXPECT_EQ(sanitize_utf8("Quito, \xc3\xb1\xc3\xba, \xf0\x9f\x9a\x81, \xe2\x82\xac"),
            "Quito, \xc3\xb1\xc3\xba, \xf0\x9f\x9a\x81, \xe2\x82\xac");
  EXPECT_EQ(sanitize_utf8("a\xff"
                          "b\xc3"),
            "a?b?");
  EXPECT_EQ(sanitize_utf8("\xc0\x80\xed\xa0\x80\xf4\x90\x80\x80"),
            "?????????");  // overlong, surrogate, beyond U+10FFFF
  EXPECT_EQ(encoded(std::string("\xe9t\xe9")), bytes({0xa3}) + "?t?");
}

TEST(Encoder, WritesManyRealsAsSingleOnes) {
  std::vector<float> reals;
  Encoder expected;
  expected.array(70000);
  for (int i = 0; i < 70000; ++i) {
    reals.push_back(static_cast<float>(i) / 16.0F);
    expected.float32(reals.back());
  }
  const std::string packed = encoded(reals);
  EXPECT_TRUE(packed == expected.take());
  EXPECT_TRUE(decoded<std::vector<float>>(packed) == reals);
}

TEST(Codec, StructuresComeBack) {
  const Outer value{{3.5F, -4.0F}, "\xc3\xb1", {0, 255}, {1.0F, 65504.0F}, {-1, 7}, {{{1, 2}, {3, 4}}}, true, 1e-9, 1U};
  const Outer again = decoded<Outer>(encoded(value));
  EXPECT_EQ(again.inner.x_val, 3.5F);
  EXPECT_EQ(again.name, value.name);
  EXPECT_EQ(again.data, value.data);
  EXPECT_EQ(again.reals, value.reals);
  EXPECT_EQ(again.numbers, value.numbers);
  EXPECT_EQ(again.matrix, value.matrix);
  EXPECT_TRUE(again.flag);
  EXPECT_EQ(again.precise, 1e-9);
  EXPECT_EQ(again.time, 1U);
}

TEST(Codec, ReadsStructuresByName) {
  const std::string reversed = bytes({0x83, 0xa5}) + "y_val" + bytes({0x07, 0xa5}) + "other" +
                               bytes({0x91, 0xc0, 0xa5}) + "x_val" + bytes({0xcb, 0x40, 0, 0, 0, 0, 0, 0, 0});
  const Inner value = decoded<Inner>(reversed);
  EXPECT_EQ(value.x_val, 2.0F);  // a float64
  EXPECT_EQ(value.y_val, 7.0F);  // a whole number
  const Inner defaults = decoded<Inner>(bytes({0x80}));
  EXPECT_EQ(defaults.x_val, 1.0F);
  EXPECT_EQ(defaults.y_val, 2.0F);
}

TEST(Codec, ReadsTextsOfEveryFormat) {
  EXPECT_EQ(decoded<std::string>(bytes({0xa1, 'a'})), "a");
  EXPECT_EQ(decoded<std::string>(bytes({0xd9, 1, 'a'})), "a");
  EXPECT_EQ(decoded<std::string>(bytes({0xda, 0, 1, 'a'})), "a");
  EXPECT_EQ(decoded<std::string>(bytes({0xdb, 0, 0, 0, 1, 'a'})), "a");
  EXPECT_EQ(decoded<std::string>(bytes({0xc4, 1, 'a'})), "a");
}

TEST(Codec, WholeNumbersMustFit) {
  EXPECT_EQ(decoded<int>(bytes({0xd2, 0x80, 0, 0, 0})), std::numeric_limits<int>::min());
  EXPECT_EQ(decoded<std::uint16_t>(bytes({0xcd, 0xff, 0xff})), 65535);
  EXPECT_EQ(decoded<std::uint64_t>(bytes({0xcf, 255, 255, 255, 255, 255, 255, 255, 255})), ~std::uint64_t{0});
  EXPECT_THAT(
      [&] {
        decoded<int>(bytes({0xce, 0x80, 0, 0, 0}));
      },
      ThrowsMessage<DecodeError>(HasSubstr("expected an integer from -2147483648 to 2147483647")));
  EXPECT_THAT([&] { decoded<std::uint16_t>(bytes({0xff})); },
              ThrowsMessage<DecodeError>(HasSubstr("expected an integer from 0 to 65535")));
  EXPECT_THAT(
      [&] {
        decoded<int>(bytes({0xd3, 0x80, 0, 0, 0, 0, 0, 0, 0}));
      },
      ThrowsMessage<DecodeError>(HasSubstr("expected an integer from -2147483648 to 2147483647")));
  EXPECT_THAT(
      [] {
        decoded<int>(bytes({0xca, 0x3f, 0x80, 0, 0}));
      },
      ThrowsMessage<DecodeError>("expected an integer, got a float"));
}

TEST(Codec, FloatsBeyondTheirRangeAreInfinite) {
  EXPECT_EQ(decoded<float>(encoded(3e38)), 3e38F);
  EXPECT_EQ(decoded<float>(encoded(1e300)), std::numeric_limits<float>::infinity());
  EXPECT_EQ(decoded<float>(encoded(-1e300)), -std::numeric_limits<float>::infinity());
  EXPECT_TRUE(std::isnan(decoded<float>(encoded(std::nan("")))));
}

TEST(Codec, FaultsSayWhere) {
  const auto vectors = bytes({0x92, 0x80, 0x81, 0xa5}) + "x_val" + bytes({0xa1, 'a'});
  EXPECT_THAT([&] { decoded<std::vector<Inner>>(vectors); },
              ThrowsMessage<DecodeError>("element 1: x_val: expected a number, got a string"));
  EXPECT_THAT([&] { decoded<Inner>(bytes({0x90})); },
              ThrowsMessage<DecodeError>(HasSubstr("expected a map, got an array")));
  using Pair = std::array<float, 2>;
  EXPECT_THAT([&] { decoded<Pair>(bytes({0x93, 1, 2, 3})); }, ThrowsMessage<DecodeError>(HasSubstr("2 values")));
}

}  // namespace
}  // namespace tileflight::rpc
