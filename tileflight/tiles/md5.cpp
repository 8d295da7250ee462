#include "tileflight/tiles/md5.h"

#include <bit>
#include <cmath>
#include <cstring>
#include <string>

namespace tileflight::tiles {
namespace {

/// RFC 1321, section 3.4: the integer part of 2^32 |sin i|.
std::array<std::uint32_t, 64> sine_table() {
  std::array<std::uint32_t, 64> table{};
  for (std::size_t i = 0; i < 64; ++i) {
    table[i] = static_cast<std::uint32_t>(std::floor(std::ldexp(std::abs(std::sin(static_cast<double>(i + 1))), 32)));
  }
  return table;
}

/// One step's function of b, c and d, and which word of the block it takes.
std::pair<std::uint32_t, std::uint32_t> step(std::uint32_t i, std::uint32_t b, std::uint32_t c, std::uint32_t d) {
  if (i < 16) return {(b & c) | (~b & d), i};
  if (i < 32) return {(d & b) | (~d & c), (5 * i + 1) % 16};
  if (i < 48) return {b ^ c ^ d, (3 * i + 5) % 16};
  return {c ^ (b | ~d), (7 * i) % 16};
}

void add_block(const char* block, const std::array<std::uint32_t, 64>& sines, std::array<std::uint32_t, 4>& state) {
  static constexpr int kShifts[4][4] = {{7, 12, 17, 22}, {5, 9, 14, 20}, {4, 11, 16, 23}, {6, 10, 15, 21}};
  std::array<std::uint32_t, 16> words{};
  std::memcpy(words.data(), block, 64);
  auto [a, b, c, d] = state;
  for (std::uint32_t i = 0; i < 64; ++i) {
    const auto [mixed, word] = step(i, b, c, d);
    const std::uint32_t sum = a + mixed + sines[i] + words[word];
    a = d;
    d = c;
    c = b;
    b += std::rotl(sum, kShifts[i / 16][i % 4]);
  }
  state[0] += a;
  state[1] += b;
  state[2] += c;
  state[3] += d;
}

}  // namespace

std::array<std::uint8_t, 16> md5(std::string_view bytes) {
  std::string padded(bytes);
  padded += '\x80';
  padded.resize((padded.size() + 8 + 63) / 64 * 64 - 8, '\0');
  const std::uint64_t bits = bytes.size() * 8;
  padded.append(reinterpret_cast<const char*>(&bits), sizeof bits);
  const std::array<std::uint32_t, 64> sines = sine_table();
  std::array<std::uint32_t, 4> state = {0x67452301, 0xEFCDAB89, 0x98BADCFE, 0x10325476};
  for (std::size_t i = 0; i < padded.size(); i += 64) add_block(padded.data() + i, sines, state);
  std::array<std::uint8_t, 16> out{};
  std::memcpy(out.data(), state.data(), sizeof out);
  return out;
}

}  // namespace tileflight::tiles
