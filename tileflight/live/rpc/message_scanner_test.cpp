#include "tileflight/live/rpc/message_scanner.h"

#include <gmock/gmock.h>

#include <msgpack.hpp>
#include <random>

namespace tileflight::rpc::message_scanner_test {
namespace {

using testing::HasSubstr;
using testing::Optional;
using testing::ThrowsMessage;

std::string bytes(std::initializer_list<int> values) {
  std::string result;
  for (const int value : values) result += static_cast<char>(value);
  return result;
}

std::optional<std::size_t> scan(const std::string& message, const MessageLimits& limits = {}) {
  return MessageScanner(limits).find_message_end(message);
}

/// A value of any kind, with others inside up to `depth`.
void pack_random(msgpack::packer<msgpack::sbuffer>& out, std::mt19937& random, int depth) {
  const std::string text(random() % (random() % 8 == 0 ? 70000 : 300), 'x');
  const auto size = static_cast<std::uint32_t>(text.size());
  switch (random() % (depth > 0 ? 12 : 10)) {
    case 0:
      out.pack_nil();
      break;
    case 1:
      out.pack_true();
      break;
    case 2:
      out.pack_int64(static_cast<std::int64_t>(random()) - 2'000'000'000);
      break;
    case 3:
      out.pack_uint64(std::uint64_t{random()} << random() % 32);
      break;
    case 4:
      out.pack_float(1.5F);
      break;
    case 5:
      out.pack_double(-2.5);
      break;
    case 6:
      out.pack_str(size).pack_str_body(text.data(), size);
      break;
    case 7:
      out.pack_bin(size).pack_bin_body(text.data(), size);
      break;
    case 8:
      out.pack_ext(size, 5).pack_ext_body(text.data(), size);
      break;
    case 9: {
      const std::uint32_t n = 1U << random() % 5;
      out.pack_ext(n, 5).pack_ext_body("0123456789abcdef", n);
      break;
    }
    case 10: {
      const std::uint32_t n = random() % 20;
      out.pack_array(n);
      for (std::uint32_t i = 0; i < n; ++i) pack_random(out, random, depth - 1);
      break;
    }
    default: {
      const std::uint32_t n = random() % 20;
      out.pack_map(n);
      for (std::uint32_t i = 0; i < 2 * n; ++i) pack_random(out, random, depth - 1);
    }
  }
}

TEST(MessageScanner, FindsTheEndOfPing) {
  const std::string ping = bytes({0x94, 0x00, 0x00, 0xa4, 'p', 'i', 'n', 'g', 0x90});
  EXPECT_THAT(scan(ping), Optional(ping.size()));
  EXPECT_THAT(scan(ping + "next"), Optional(ping.size()));
  for (std::size_t i = 0; i < ping.size(); ++i) EXPECT_EQ(scan(ping.substr(0, i)), std::nullopt) << i;
}

/// Oracle: the library's own parser; the scanner must find the same message end, in one call and byte by byte.
TEST(MessageScanner, AgreesWithTheLibrary) {
  std::mt19937 random(3);
  for (int round = 0; round < 40; ++round) {
    msgpack::sbuffer buffer;
    msgpack::packer<msgpack::sbuffer> out(buffer);
    out.pack_array(4);
    for (int i = 0; i < 4; ++i) pack_random(out, random, 3);
    const std::string message(buffer.data(), buffer.size());
    std::size_t end = 0;
    msgpack::unpack(message.data(), message.size(), end);
    ASSERT_THAT(scan(message), Optional(end)) << round;
    ASSERT_EQ(scan(message.substr(0, end - 1)), std::nullopt) << round;
    MessageScanner scanner{MessageLimits{}};
    std::size_t given = 0;
    std::optional<std::size_t> found;
    while (!found && given < message.size()) {
      given = std::min(message.size(), given + 1 + random() % 977);
      found = scanner.find_message_end(message.substr(0, given));
    }
    ASSERT_THAT(found, Optional(end)) << round;
  }
}

TEST(MessageScanner, BelievesNoClaim) {
  const std::string four_giga_values = bytes({0x94, 0x00, 0x00, 0xdd, 0xff, 0xff, 0xff, 0xff});
  EXPECT_THAT([&] { scan(four_giga_values); }, ThrowsMessage<ProtocolError>(HasSubstr("values")));
  const std::string four_giga_entries = bytes({0x94, 0x00, 0x00, 0xdf, 0xff, 0xff, 0xff, 0xff});
  EXPECT_THAT([&] { scan(four_giga_entries); }, ThrowsMessage<ProtocolError>(HasSubstr("values")));
  const std::string four_giga_text = bytes({0x94, 0x00, 0x00, 0xdb, 0xff, 0xff, 0xff, 0xff});
  EXPECT_THAT([&] { scan(four_giga_text); }, ThrowsMessage<ProtocolError>(HasSubstr("bytes")));
}

TEST(MessageScanner, SumsUpWhatASeriesOfClaimsPromises) {
  std::string message = bytes({0x94});
  const std::string thousand = bytes({0xdc, 0x03, 0xe8});
  for (int i = 0; i < 20; ++i) message += thousand;
  EXPECT_THAT([&] { scan(message, {.max_values = 10'000}); }, ThrowsMessage<ProtocolError>(HasSubstr("10000 values")));
}

TEST(MessageScanner, BoundsDepthAndBytes) {
  EXPECT_THAT([] { scan(bytes({0x94}) + std::string(40, '\x91')); },
              ThrowsMessage<ProtocolError>(HasSubstr("32 deep")));
  const std::string text = bytes({0x94, 0x00, 0x00, 0xd9, 200}) + std::string(200, 'x') + bytes({0x90});
  EXPECT_THAT(scan(text, {.max_bytes = 206}), Optional(std::size_t{206}));
  EXPECT_THAT([&] { scan(text, {.max_bytes = 205}); }, ThrowsMessage<ProtocolError>(HasSubstr("205 bytes")));
}

TEST(MessageScanner, RefusesWhatIsNoMessageAtItsFirstByte) {
  const auto expect_refused = [](int first, const char* message) {
    EXPECT_THAT(
        [&] {
          scan(bytes({first, 0xff, 0xff, 0xff, 0xff}));
        },
        ThrowsMessage<ProtocolError>(HasSubstr(message)))
        << first;
  };
  for (const int first : {0x00, 0xc0, 0x47, 0xdb, 0x93 + 2, 0x90, 0xe0})
    expect_refused(first, "a message is an array of 4 values");
  expect_refused(0xc1, "byte 0xc1, which cannot start a MessagePack value");
}

}  // namespace
}  // namespace tileflight::rpc::message_scanner_test
