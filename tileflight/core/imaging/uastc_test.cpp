#include "tileflight/core/imaging/uastc.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

#include "tileflight/core/base/test_byte_strings.h"

namespace tileflight::imaging::uastc_test {
namespace {

using base::test_support::error_of;
using ::testing::HasSubstr;

/// Bit offsets of the parts of a block, by the specification's layouts of the modes (-1: the mode has no such part).
struct Layout {
  int mode;
  unsigned code;
  int selector_at;
  int pattern_at;
  int digits_at;
  int bits_at;
  int weights_at;
  std::size_t channels;
  std::size_t subsets;
  std::size_t planes;
  unsigned endpoint_bits;
  unsigned base;
  unsigned weight_bits;
};

const std::vector<Layout> kLayouts = {
    {0, 1, -1, -1, 19, 29, 65, 3, 1, 1, 6, 3, 4},   {1, 53, -1, -1, -1, 21, 69, 3, 1, 1, 8, 1, 2},
    {2, 29, -1, 20, -1, 25, 73, 3, 2, 1, 4, 1, 3},  {3, 3, -1, 20, 24, 53, 89, 3, 3, 1, 2, 3, 2},
    {4, 19, -1, 20, 25, 53, 89, 3, 2, 1, 3, 5, 2},  {5, 11, -1, -1, -1, 20, 68, 3, 1, 1, 8, 1, 3},
    {6, 27, 20, -1, 22, 36, 66, 3, 1, 2, 5, 5, 2},  {7, 7, -1, 20, 25, 53, 89, 3, 2, 1, 3, 5, 2},
    {9, 15, -1, 28, -1, 33, 97, 4, 2, 1, 4, 1, 2},  {10, 2, -1, -1, 20, 33, 65, 4, 1, 1, 4, 3, 4},
    {11, 0, 19, -1, 21, 34, 66, 4, 1, 2, 4, 3, 2},  {12, 6, -1, -1, 20, 33, 81, 4, 1, 1, 6, 3, 3},
    {13, 31, 28, -1, -1, 30, 94, 4, 1, 2, 8, 1, 1}, {14, 13, -1, -1, -1, 28, 92, 4, 1, 1, 8, 1, 2},
    {15, 5, -1, -1, -1, 30, 62, 2, 1, 1, 8, 1, 4},  {16, 21, -1, 29, -1, 34, 98, 2, 2, 1, 8, 1, 2},
    {17, 37, -1, -1, -1, 29, 61, 2, 1, 2, 8, 1, 2}, {18, 9, -1, -1, -1, 19, 49, 3, 1, 1, 5, 1, 5}};

/// Texels of subset 1 (bit 4 y + x) of the patterns of two subsets that ASTC and BC7 share.
constexpr std::array<unsigned, 30> kTwo = {0xCCCC, 0x8888, 0x1111, 0xECC8, 0x377F, 0xFEEC, 0x0137, 0x137F,
                                           0xC800, 0x0013, 0xFE80, 0x17FF, 0x0017, 0x00FF, 0xFFF0, 0x0FFF,
                                           0xFF71, 0x8EFF, 0x08CE, 0x008C, 0x7310, 0xCEFF, 0x7331, 0x088C,
                                           0xCEEF, 0x6666, 0xF00F, 0x5555, 0x0F0F, 0x36C9};
/// The patterns of mode 7.
constexpr std::array<unsigned, 19> kMerged = {0x00F0, 0x4444, 0x0133, 0xCC80, 0xF0FF, 0x2222, 0xFFC8,
                                              0xCCCE, 0x3C03, 0x00EE, 0x7700, 0x3003, 0x00CE, 0xFF80,
                                              0x6FFF, 0x1333, 0x11FF, 0x136C, 0x00EF};
/// Texels of subset 2 in the upper bits, of subset 1 in the lower, mode 3.
constexpr std::array<unsigned, 11> kThree = {0xCC003300, 0xF00000FF, 0xF000000F, 0x00F0000F, 0x44443333, 0x88886666,
                                             0x2222CCCC, 0x1111EE00, 0x99994444, 0x0F00F00F, 0xC00C0CC0};

std::array<std::size_t, 16> subsets_of(const Layout& layout, std::size_t pattern) {
  std::array<std::size_t, 16> out{};
  if (layout.subsets == 1) return out;
  const unsigned mask = layout.subsets == 3 ? kThree[pattern] : layout.mode == 7 ? kMerged[pattern] : kTwo[pattern];
  for (std::size_t t = 0; t < 16; ++t)
    out[t] = (mask >> t & 1U) + 2 * (layout.subsets == 3 ? mask >> (16 + t) & 1U : 0);
  return out;
}

std::size_t pattern_count(const Layout& layout) {
  return layout.subsets == 1   ? 1
         : layout.subsets == 3 ? kThree.size()
         : layout.mode == 7    ? kMerged.size()
                               : kTwo.size();
}

/// Value of an endpoint: `rank` steps of the whole range from 0 up, or from 255 down if the lowest bit is set.
double endpoint_value(const Layout& layout, unsigned bits, unsigned digit) {
  const unsigned count = layout.base << layout.endpoint_bits;
  if (layout.base == 1) return bits * 255.0 / (count - 1);
  const double from_end = ((bits >> 1U) * layout.base + digit) * 255.0 / (count - 1);
  return (bits & 1U) != 0 ? 255.0 - from_end : from_end;
}

struct Block {
  std::array<std::byte, 16> bytes{};

  void set(unsigned at, unsigned count, unsigned value) {
    for (unsigned i = 0; i < count; ++i) {
      const std::byte bit{static_cast<unsigned char>(1U << ((at + i) % 8))};
      std::byte& byte = bytes[(at + i) / 8];
      byte = (value >> i & 1U) != 0 ? byte | bit : byte & ~bit;
    }
  }
};

/// The fields of a block, and the image that they encode.
struct Fields {
  unsigned selector = 0;
  std::size_t pattern = 0;
  std::vector<unsigned> digits;                       ///< of the endpoints
  std::vector<unsigned> bits;                         ///< of the endpoints
  std::array<std::array<unsigned, 2>, 16> weights{};  ///< by texel and plane
};

std::size_t endpoint_count(const Layout& layout) { return 2 * layout.channels * layout.subsets; }

Fields random_fields(const Layout& layout, std::mt19937& random) {
  Fields out;
  out.selector = static_cast<unsigned>(random() % layout.channels);
  out.pattern = random() % pattern_count(layout);
  for (std::size_t i = 0; i < endpoint_count(layout); ++i) {
    out.digits.push_back(static_cast<unsigned>(random() % layout.base));
    out.bits.push_back(static_cast<unsigned>(random() % (1U << layout.endpoint_bits)));
  }
  std::vector<bool> begun(3, false);
  const auto subsets = subsets_of(layout, out.pattern);
  for (std::size_t t = 0; t < 16; ++t) {
    const unsigned levels = 1U << (begun[subsets[t]] ? layout.weight_bits : layout.weight_bits - 1);
    begun[subsets[t]] = true;
    for (unsigned& weight : out.weights[t]) weight = static_cast<unsigned>(random() % levels);
  }
  return out;
}

void write_digits(const Layout& layout, const std::vector<unsigned>& digits, Block& block) {
  const std::size_t group = layout.base == 3 ? 5 : 3;
  auto at = static_cast<unsigned>(layout.digits_at);
  for (std::size_t i = 0; i < digits.size(); i += group) {
    unsigned together = 0;
    unsigned highest = 0;
    for (std::size_t k = std::min(i + group, digits.size()); k-- > i;) {
      together = together * layout.base + digits[k];
      highest = highest * layout.base + layout.base - 1;
    }
    const auto count = static_cast<unsigned>(std::bit_width(highest));  // bits of the largest value
    block.set(at, count, together);
    at += count;
  }
  EXPECT_EQ(at, static_cast<unsigned>(layout.bits_at));
}

Block write(const Layout& layout, const Fields& fields, unsigned noise) {
  Block block;
  for (unsigned i = 0; i < 16; ++i) block.set(8 * i, 8, noise * (i + 1) % 251);  // hints may be anything
  static constexpr std::array<unsigned, 19> kCodeBits = {4, 6, 5, 5, 5, 5, 5, 5, 5, 5, 3, 2, 3, 5, 5, 7, 6, 6, 4};
  block.set(0, kCodeBits[static_cast<std::size_t>(layout.mode)], layout.code);
  if (layout.selector_at >= 0) block.set(static_cast<unsigned>(layout.selector_at), 2, fields.selector);
  if (layout.pattern_at >= 0) {
    block.set(static_cast<unsigned>(layout.pattern_at), layout.subsets == 3 ? 4 : 5,
              static_cast<unsigned>(fields.pattern));
  }
  if (layout.base > 1) write_digits(layout, fields.digits, block);
  auto at = static_cast<unsigned>(layout.bits_at);
  for (const unsigned bits : fields.bits) {
    block.set(at, layout.endpoint_bits, bits);
    at += layout.endpoint_bits;
  }
  EXPECT_EQ(at, static_cast<unsigned>(layout.weights_at));
  std::vector<bool> begun(3, false);
  const auto subsets = subsets_of(layout, fields.pattern);
  for (std::size_t t = 0; t < 16; ++t) {
    const unsigned count = begun[subsets[t]] ? layout.weight_bits : layout.weight_bits - 1;
    begun[subsets[t]] = true;
    for (std::size_t p = 0; p < layout.planes; ++p, at += count) block.set(at, count, fields.weights[t][p]);
  }
  EXPECT_LE(at, 128U);
  return block;
}

/// Exact (real) grey value of a texel's channel; 3: alpha.
double meant(const Layout& layout, const Fields& fields, std::size_t texel, std::size_t channel) {
  if (channel == 3 && layout.channels == 3) return 255.0;
  const std::size_t subset = subsets_of(layout, fields.pattern)[texel];
  const std::size_t stored = layout.channels == 2 ? channel / 3 : channel;  // luminance stands for the colours
  const std::size_t first = subset * 2 * layout.channels + 2 * stored;
  const bool second = layout.planes == 2 && (layout.channels == 2 ? 3 : fields.selector) == channel;
  const double weight = fields.weights[texel][second ? 1 : 0] / ((1U << layout.weight_bits) - 1.0);
  const double low = endpoint_value(layout, fields.bits[first], fields.digits[first]);
  const double high = endpoint_value(layout, fields.bits[first + 1], fields.digits[first + 1]);
  return low + (high - low) * weight;
}

/// The specification's integer results stay within five grey values of the exact ones. A field read from the wrong
/// place gives an error of 80 on average.
TEST(Uastc, RandomBlocksOfEveryModeHaveTheColoursThatTheirFieldsMean) {
  std::mt19937 random(3);
  for (const Layout& layout : kLayouts) {
    for (int i = 0; i < 400; ++i) {
      const Fields fields = random_fields(layout, random);
      const Block block = write(layout, fields, static_cast<unsigned>(random()));
      const RgbImage image = decode_uastc(block.bytes, 4, 4, i % 2 == 0, "u");
      const GrayImage alpha = decode_uastc_alpha(block.bytes, 4, 4, "u");
      for (std::size_t t = 0; t < 16; ++t) {
        for (std::size_t c = 0; c < 3; ++c) {
          ASSERT_NEAR(image.pixels[t][c], meant(layout, fields, t, c), 5) << "mode " << layout.mode << " texel " << t;
        }
        ASSERT_NEAR(alpha.pixels[t], meant(layout, fields, t, 3), 5) << "mode " << layout.mode << " texel " << t;
      }
    }
  }
}

TEST(Uastc, EveryPatternPartsTheTexelsAsItsPictureDoes) {
  for (const Layout& layout : kLayouts) {
    for (std::size_t pattern = 0; layout.subsets > 1 && pattern < pattern_count(layout); ++pattern) {
      Fields fields;
      fields.pattern = pattern;
      fields.digits.assign(endpoint_count(layout), 0);
      fields.bits.assign(endpoint_count(layout), 0);
      for (std::size_t i = 2 * layout.channels; i < endpoint_count(layout); ++i) fields.bits[i] = 1;  // 255
      for (std::size_t i = 4 * layout.channels; i < endpoint_count(layout); ++i) fields.bits[i] = 2;
      const RgbImage image = decode_uastc(write(layout, fields, 7).bytes, 4, 4, true, "u");
      const auto subsets = subsets_of(layout, pattern);
      for (std::size_t t = 0; t < 16; ++t) {
        const unsigned bits = static_cast<unsigned>(subsets[t]);
        EXPECT_NEAR(image.pixels[t][0], endpoint_value(layout, bits, 0), 1) << "mode " << layout.mode << " " << pattern;
      }
    }
  }
}

/// The tables of the specification, by digit (rows) and bits (columns), where they are short enough to be written.
TEST(Uastc, EndpointsAreThoseOfTheTables) {
  const std::vector<int> range12 = {0, 255, 69, 186, 23, 232, 92, 163, 46, 209, 116, 139};
  const std::vector<int> range40 = {0,   255, 32,  223, 65, 190, 97, 158, 6,   249, 39,  216, 71, 184,
                                    104, 151, 13,  242, 45, 210, 78, 177, 110, 145, 19,  236, 52, 203,
                                    84,  171, 117, 138, 26, 229, 58, 197, 91,  164, 123, 132};
  const std::vector<int> range48 = {0,  255, 16, 239, 32, 223, 48, 207, 65, 190, 81, 174, 97,  158, 113, 142,
                                    5,  250, 21, 234, 38, 217, 54, 201, 70, 185, 86, 169, 103, 152, 119, 136,
                                    11, 244, 27, 228, 43, 212, 59, 196, 76, 179, 92, 163, 108, 147, 124, 131};
  for (const auto& [mode, table] : {std::pair{3, range12}, {7, range40}, {10, range48}}) {
    const Layout& layout =
        *std::find_if(kLayouts.begin(), kLayouts.end(), [wanted = mode](const Layout& l) { return l.mode == wanted; });
    for (unsigned i = 0; i < table.size(); ++i) {
      Fields fields;
      fields.digits.assign(endpoint_count(layout), i >> layout.endpoint_bits);
      fields.bits.assign(endpoint_count(layout), i & ((1U << layout.endpoint_bits) - 1U));
      const RgbImage image = decode_uastc(write(layout, fields, 1).bytes, 4, 4, true, "u");
      EXPECT_EQ(image.pixels[5][1], table[i]) << "mode " << mode << " value " << i;
    }
  }
}

TEST(Uastc, BlocksOfAnyBitsAreDecodedOrNamed) {
  std::mt19937 random(17);
  int decoded = 0;
  for (int i = 0; i < 20000; ++i) {
    Block block;
    for (std::byte& byte : block.bytes) byte = static_cast<std::byte>(random());
    const std::string message = base::test_support::error_of([&] { decode_uastc(block.bytes, 4, 4, true, "u"); });
    EXPECT_THAT(message, ::testing::AnyOf("", HasSubstr("undefined"))) << i;
    decoded += message.empty() ? 1 : 0;
  }
  EXPECT_GT(decoded, 15000);
}

Block solid(unsigned red, unsigned green, unsigned blue) {
  Block block;
  block.set(0, 5, 23);
  block.set(5, 8, red);
  block.set(13, 8, green);
  block.set(21, 8, blue);
  block.set(29, 8, 255);
  return block;
}

TEST(Uastc, BlocksStandRowByRowAndAreCutAtThePictureSEdge) {
  std::vector<std::byte> bytes;
  for (unsigned i = 0; i < 6; ++i) {
    const Block block = solid(10 * i, 255, i);
    bytes.insert(bytes.end(), block.bytes.begin(), block.bytes.end());
  }
  const RgbImage image = decode_uastc(bytes, 9, 5, false, "u");
  EXPECT_EQ(uastc_bytes(9, 5), bytes.size());
  for (int y = 0; y < 5; ++y) {
    for (int x = 0; x < 9; ++x) {
      const auto i = static_cast<std::uint8_t>(3 * (y / 4) + x / 4);
      EXPECT_EQ(image(x, y), (Rgb8{static_cast<std::uint8_t>(10 * i), 255, i}));
    }
  }
}

TEST(Uastc, FaultsAreNamed) {
  EXPECT_THAT(base::test_support::error_of([] { decode_uastc(solid(1, 2, 3).bytes, 5, 4, true, "u"); }),
              HasSubstr("truncated"));
  Block reserved;
  reserved.set(0, 7, 69);
  EXPECT_THAT(base::test_support::error_of([&] { decode_uastc(reserved.bytes, 4, 4, true, "u"); }),
              HasSubstr("an undefined mode"));
  for (const auto& [code, at, count, index] :
       {std::array<unsigned, 4>{29, 20, 5, 30}, {3, 20, 4, 11}, {7, 20, 5, 19}}) {
    Block block;
    block.set(0, 5, code);
    block.set(at, count, index);
    EXPECT_THAT(base::test_support::error_of([&] { decode_uastc(block.bytes, 4, 4, true, "u"); }),
                HasSubstr("an undefined pattern"));
    block.set(at, count, index - 1);
    EXPECT_EQ(base::test_support::error_of([&] { decode_uastc(block.bytes, 4, 4, true, "u"); }), "");
  }
}

}  // namespace
}  // namespace tileflight::imaging::uastc_test
