#include "tileflight/core/imaging/uastc.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <utility>

#include "tileflight/core/base/input_error.h"

namespace tileflight::imaging {
namespace {

// A block is 128 bits, read from the lowest: the mode's prefix code, hints for transcoders (unused here), for some
// modes the channel that uses the second weight plane, for some the pattern that divides the texels into subsets, the
// endpoints of each subset, and the weights of the texels.

constexpr std::size_t kBlockBytes = 16;
constexpr int kBlockSide = 4;
constexpr std::size_t kTexels = 16;
constexpr std::size_t kMaxEndpoints = 18;  // three subsets of RGB

/// Encoding of endpoint values: `bits` bits, and above them one digit of base 3 or 5 (base 1: none).
struct Quantization {
  unsigned bits;
  unsigned base;
};

struct Mode {
  unsigned code;  ///< first bit lowest
  unsigned code_bits;
  unsigned hint_bits;
  std::size_t channels;  ///< 2: luminance and alpha; 3: RGB; 4: RGBA
  std::size_t subsets;
  std::size_t planes;
  Quantization endpoints;
  unsigned weight_bits;
};

constexpr std::size_t kSolid = 8;       // a single colour of eight bits a channel follows the code
constexpr std::size_t kMergedMode = 7;  // its two subsets use separate patterns
constexpr std::array<Mode, 19> kModes = {{
    {0b0001, 4, 15, 3, 1, 1, {6, 3}, 4},   {0b110101, 6, 15, 3, 1, 1, {8, 1}, 2},
    {0b11101, 5, 15, 3, 2, 1, {4, 1}, 3},  {0b00011, 5, 15, 3, 3, 1, {2, 3}, 2},
    {0b10011, 5, 15, 3, 2, 1, {3, 5}, 2},  {0b01011, 5, 15, 3, 1, 1, {8, 1}, 3},
    {0b11011, 5, 15, 3, 1, 2, {5, 5}, 2},  {0b00111, 5, 15, 3, 2, 1, {3, 5}, 2},
    {0b10111, 5, 0, 4, 0, 0, {8, 1}, 0},   {0b01111, 5, 23, 4, 2, 1, {4, 1}, 2},
    {0b010, 3, 17, 4, 1, 1, {4, 3}, 4},    {0b00, 2, 17, 4, 1, 2, {4, 3}, 2},
    {0b110, 3, 17, 4, 1, 1, {6, 3}, 3},    {0b11111, 5, 23, 4, 1, 2, {8, 1}, 1},
    {0b01101, 5, 23, 4, 1, 1, {8, 1}, 2},  {0b0000101, 7, 23, 2, 1, 1, {8, 1}, 4},
    {0b010101, 6, 23, 2, 2, 1, {8, 1}, 2}, {0b100101, 6, 23, 2, 1, 2, {8, 1}, 2},
    {0b1001, 4, 15, 3, 1, 1, {5, 1}, 5},
}};

/// Subset of each texel, row by row.
using Pattern = std::array<std::uint8_t, kTexels>;

/// Khronos Data Format Specification 1.3, section 23.22 "Partition Pattern Generation": a hash of the seed.
constexpr std::uint32_t hash52(std::uint32_t p) {
  p ^= p >> 15U;
  p *= 0xEEDE0891U;
  p ^= p >> 5U;
  p += p << 16U;
  p ^= p >> 7U;
  p ^= p >> 3U;
  p ^= p << 6U;
  p ^= p >> 17U;
  return p;
}

/// Implements the section named above for blocks of fewer than 31 texels: the subset whose pseudo-random plane has the
/// largest value.
constexpr std::uint8_t subset_of(std::uint32_t seed, std::uint32_t subsets, std::uint32_t x, std::uint32_t y) {
  const std::uint32_t random = hash52(seed + (subsets - 1) * 1024);
  const std::uint32_t third = subsets == 3 ? 6 : 5;
  const std::uint32_t second = (seed & 2U) != 0 ? 4 : 5;
  const std::array<std::uint32_t, 2> shifts = (seed & 1U) != 0 ? std::array{second, third} : std::array{third, second};
  std::array<std::uint32_t, 3> height{};
  for (std::uint32_t i = 0; i < subsets; ++i) {
    const std::uint32_t slope_x = random >> (8 * i) & 15U;
    const std::uint32_t slope_y = random >> (8 * i + 4) & 15U;
    const std::uint32_t across = (slope_x * slope_x) >> shifts[0];
    const std::uint32_t down = (slope_y * slope_y) >> shifts[1];
    height[i] = (across * 2 * x + down * 2 * y + (random >> (14 - 4 * i))) & 63U;
  }
  std::uint8_t best = 0;
  for (std::uint32_t i = 1; i < subsets; ++i) {
    if (height[i] > height[best]) best = static_cast<std::uint8_t>(i);
  }
  return best;
}

template <std::size_t N>
constexpr std::array<Pattern, N> patterns_of(const std::array<std::uint32_t, N>& seeds, std::uint32_t subsets) {
  std::array<Pattern, N> out{};
  for (std::size_t i = 0; i < N; ++i) {
    for (std::uint32_t t = 0; t < kTexels; ++t) out[i][t] = subset_of(seeds[i], subsets, t % 4, t / 4);
  }
  return out;
}

/// Two-subset patterns common to ASTC and BC7, by their ASTC seeds.
constexpr auto kPatternsOfTwo =
    patterns_of<30>({28, 20,  16,  29, 91,  9,   107, 72,  149, 204, 50,  114, 496, 17,  78,
                     39, 252, 828, 43, 156, 116, 210, 476, 273, 684, 359, 246, 195, 694, 524},
                    2);
constexpr auto kPatternsOfThree = patterns_of<11>({260, 74, 32, 156, 183, 15, 745, 0, 335, 902, 254}, 3);
/// Two-subset patterns of ASTC that equal a three-subset pattern of BC7 with two subsets merged.
constexpr auto kMergedPatterns =
    patterns_of<19>({36, 48, 61, 137, 161, 183, 226, 281, 302, 307, 479, 495, 593, 594, 605, 799, 812, 988, 993}, 2);

class BlockBits {
 public:
  explicit BlockBits(std::span<const std::byte, kBlockBytes> block) {
    std::memcpy(&low_, block.data(), 8);
    std::memcpy(&high_, block.data() + 8, 8);
  }

  unsigned peek(unsigned count) const { return static_cast<unsigned>(low_ & ((1ULL << count) - 1ULL)); }

  unsigned take(unsigned count) {
    const unsigned value = peek(count);
    if (count == 0) return value;
    low_ = low_ >> count | high_ << (64 - count);
    high_ >>= count;
    return value;
  }

 private:
  std::uint64_t low_ = 0;
  std::uint64_t high_ = 0;
};

std::size_t mode_of(const BlockBits& bits, const std::string& name) {
  const auto* mode = std::find_if(kModes.begin(), kModes.end(), [&](const Mode& candidate) {
    return bits.peek(candidate.code_bits) == candidate.code;
  });
  if (mode == kModes.end()) throw InputError(name, "a block of the UASTC texture has an undefined mode");
  return static_cast<std::size_t>(mode - kModes.begin());
}

const Pattern& read_pattern(BlockBits& bits, std::size_t mode, const std::string& name) {
  static constexpr Pattern kWhole{};
  const auto choose = [&](std::span<const Pattern> patterns, unsigned index_bits) -> const Pattern& {
    const unsigned index = bits.take(index_bits);
    if (index >= patterns.size()) throw InputError(name, "a block of the UASTC texture has an undefined pattern");
    return patterns[index];
  };
  if (kModes[mode].subsets == 1) return kWhole;
  if (kModes[mode].subsets == 3) return choose(kPatternsOfThree, 4);
  return mode == kMergedMode ? choose(kMergedPatterns, 5) : choose(kPatternsOfTwo, 5);
}

/// Five digits of base 3 are packed into 8 bits, three digits of base 5 into 7; an incomplete last group uses only the
/// bits that it needs.
void read_digits(BlockBits& bits, unsigned base, std::span<unsigned> digits) {
  static constexpr std::array<unsigned, 6> kBitsOfThrees = {0, 2, 4, 5, 7, 8};
  static constexpr std::array<unsigned, 4> kBitsOfFives = {0, 3, 5, 7};
  const std::size_t group = base == 3 ? 5 : 3;
  for (std::size_t i = 0; i < digits.size(); i += group) {
    const std::size_t count = std::min(group, digits.size() - i);
    unsigned together = bits.take(base == 3 ? kBitsOfThrees[count] : kBitsOfFives[count]);
    for (std::size_t k = 0; k < count; ++k, together /= base) digits[i + k] = together % base;
  }
}

/// Expands to eight bits by replicating the upper bits.
unsigned to_eight_bits(unsigned value, unsigned bits) {
  unsigned out = value << (8 - bits);
  for (unsigned filled = bits; filled < 8; filled *= 2) out |= out >> filled;
  return out;
}

/// Khronos Data Format Specification 1.3, section 23.13 "Endpoint Unquantization": D C + B, inverted if the lowest bit
/// is set. B replicates the other bits to nine bits.
unsigned dequantize(unsigned value, unsigned digit, Quantization q) {
  if (q.base == 1) return to_eight_bits(value, q.bits);
  const unsigned folded = (value & 1U) != 0 ? 0x1FFU : 0U;
  const unsigned upper = value >> 1U;
  unsigned sum = 0;
  if (q.base == 3 && q.bits == 2) sum = digit * 93 + upper * 0b100010110U;
  if (q.base == 3 && q.bits == 4) sum = digit * 22 + (upper << 6U | upper);
  if (q.base == 3 && q.bits == 6) sum = digit * 5 + (upper << 4U | upper >> 4U);
  if (q.base == 5 && q.bits == 3) sum = digit * 26 + (upper << 7U | upper << 1U | upper >> 1U);
  if (q.base == 5 && q.bits == 5) sum = digit * 6 + (upper << 5U | upper >> 3U);
  return (folded & 0x80U) | ((sum ^ folded) >> 2U);
}

using Endpoints = std::array<unsigned, kMaxEndpoints>;  ///< by subset, channel, and low or high

Endpoints read_endpoints(BlockBits& bits, const Mode& mode) {
  const std::size_t count = 2 * mode.channels * mode.subsets;
  Endpoints digits{};
  if (mode.endpoints.base > 1) read_digits(bits, mode.endpoints.base, std::span(digits).first(count));
  Endpoints out{};
  for (std::size_t i = 0; i < count; ++i)
    out[i] = dequantize(bits.take(mode.endpoints.bits), digits[i], mode.endpoints);
  return out;
}

/// Section 23.17 "Weight Unquantization": 0 to 64.
unsigned dequantize_weight(unsigned value, unsigned bits) {
  unsigned six = value << (6 - bits);
  for (unsigned filled = bits; filled < 6; filled *= 2) six |= six >> filled;
  return six > 32 ? six + 1 : six;
}

using Weights = std::array<std::array<unsigned, 2>, kTexels>;  ///< by texel and plane

/// The weight of each subset's first texel lacks its upper bit, which is 0.
Weights read_weights(BlockBits& bits, const Mode& mode, const Pattern& pattern) {
  Weights out{};
  std::size_t begun = 0;  // one bit for each subset
  for (std::size_t t = 0; t < kTexels; ++t) {
    const std::size_t subset = std::size_t{1} << pattern[t];
    const unsigned count = (begun & subset) == 0 ? mode.weight_bits - 1 : mode.weight_bits;
    begun |= subset;
    for (std::size_t p = 0; p < mode.planes; ++p) out[t][p] = dequantize_weight(bits.take(count), mode.weight_bits);
    if (mode.planes == 1) out[t][1] = out[t][0];
  }
  return out;
}

/// Section 23.19 "Weight Application".
std::uint8_t interpolate(unsigned low, unsigned high, unsigned weight, bool srgb) {
  const unsigned low16 = low << 8U | (srgb ? 0x80U : low);
  const unsigned high16 = high << 8U | (srgb ? 0x80U : high);
  return static_cast<std::uint8_t>((low16 * (64 - weight) + high16 * weight + 32) >> 14U);
}

using Rgba8 = std::array<std::uint8_t, 4>;
using Block = std::array<Rgba8, kTexels>;

Block solid_block(BlockBits& bits) {
  Rgba8 color;
  for (std::uint8_t& channel : color) channel = static_cast<std::uint8_t>(bits.take(8));
  Block out;
  out.fill(color);
  return out;
}

Block decode_block(std::span<const std::byte, kBlockBytes> block, bool srgb, const std::string& name) {
  BlockBits bits(block);
  const std::size_t mode_index = mode_of(bits, name);
  const Mode& mode = kModes[mode_index];
  bits.take(mode.code_bits);
  if (mode_index == kSolid) return solid_block(bits);
  bits.take(mode.hint_bits);
  // With luminance and alpha, the second plane holds alpha.
  const std::size_t second_plane = mode.planes == 2 && mode.channels > 2 ? bits.take(2) : 3;
  const Pattern& pattern = read_pattern(bits, mode_index, name);
  const Endpoints endpoints = read_endpoints(bits, mode);
  const Weights weights = read_weights(bits, mode, pattern);
  Block out;
  for (std::size_t t = 0; t < kTexels; ++t) {
    const unsigned* ends = &endpoints[pattern[t] * 2 * mode.channels];
    for (std::size_t c = 0; c < 3; ++c) {
      const std::size_t from = mode.channels == 2 ? 0 : 2 * c;
      out[t][c] = interpolate(ends[from], ends[from + 1], weights[t][c == second_plane ? 1 : 0], srgb);
    }
    const unsigned* alpha = ends + 2 * (mode.channels - 1);
    out[t][3] =
        mode.channels == 3 ? 255 : interpolate(alpha[0], alpha[1], weights[t][second_plane == 3 ? 1 : 0], false);
  }
  return out;
}

/// Calls `take` with column, row and colour of each texel of the image.
template <typename Take>
void for_each_texel(std::span<const std::byte> bytes, int width, int height, bool srgb, const std::string& name,
                    const Take& take) {
  if (bytes.size() < uastc_bytes(width, height)) throw InputError(name, "the UASTC texture is truncated");
  std::size_t at = 0;
  for (int top = 0; top < height; top += kBlockSide) {
    for (int left = 0; left < width; left += kBlockSide, at += kBlockBytes) {
      const Block block = decode_block(bytes.subspan(at).first<kBlockBytes>(), srgb, name);
      for (int y = 0; y < std::min(kBlockSide, height - top); ++y) {
        for (int x = 0; x < std::min(kBlockSide, width - left); ++x)
          take(left + x, top + y,
               block[static_cast<std::size_t>(kBlockSide) * static_cast<std::size_t>(y) + static_cast<std::size_t>(x)]);
      }
    }
  }
}

}  // namespace

std::size_t uastc_bytes(int width, int height) {
  const auto blocks = [](int side) { return static_cast<std::size_t>((side + kBlockSide - 1) / kBlockSide); };
  return blocks(width) * blocks(height) * kBlockBytes;
}

RgbImage decode_uastc(std::span<const std::byte> bytes, int width, int height, bool srgb, const std::string& name) {
  RgbImage image(width, height);
  for_each_texel(bytes, width, height, srgb, name, [&](int x, int y, const Rgba8& texel) {
    image(x, y) = {texel[0], texel[1], texel[2]};
  });
  return image;
}

GrayImage decode_uastc_alpha(std::span<const std::byte> bytes, int width, int height, const std::string& name) {
  GrayImage alpha(width, height);
  // The colour's transfer function does not concern alpha.
  for_each_texel(bytes, width, height, false, name, [&](int x, int y, const Rgba8& texel) { alpha(x, y) = texel[3]; });
  return alpha;
}

}  // namespace tileflight::imaging
