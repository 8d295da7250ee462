#include "tileflight/core/imaging/ktx2.h"

#include <gmock/gmock.h>
#include <zstd.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <random>

#include "tests/test_data.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/base/test_byte_strings.h"
#include "tileflight/core/imaging/image_files.h"
#include "tileflight/core/imaging/test_bit_writer.h"

namespace tileflight::imaging::ktx2_test {
namespace {

using base::test_support::error_of;
using base::test_support::to_bytes;
using base::test_support::to_raw_bytes;
using test_support::BitWriter;
using ::testing::AnyOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

constexpr std::int64_t kPixels = 1 << 20;

/// `channels`: identifiers of the samples that the descriptor lists.
std::string header(std::uint32_t vk_format, std::uint32_t width, std::uint32_t height, std::uint32_t scheme,
                   unsigned color_model, const std::string& global_data, const std::string& level,
                   const std::vector<unsigned>& channels = {}) {
  std::string descriptor(28 + 16 * channels.size(), '\0');
  descriptor[12] = static_cast<char>(color_model);
  for (std::size_t i = 0; i < channels.size(); ++i) descriptor[28 + 16 * i + 3] = static_cast<char>(channels[i]);
  const std::uint32_t descriptor_at = 80 + 24;
  const std::uint64_t global_at = descriptor_at + descriptor.size();
  return std::string("\xABKTX 20\xBB\r\n\x1A\n", 12) +
         base::test_support::to_raw_bytes<std::uint32_t>({vk_format, 1, width, height, 0, 0, 1, 1, scheme,
                                                          descriptor_at, static_cast<std::uint32_t>(descriptor.size()),
                                                          0, 0}) +
         base::test_support::to_raw_bytes<std::uint64_t>({global_data.empty() ? 0 : global_at, global_data.size(),
                                                          global_at + global_data.size(), level.size(), 0}) +
         descriptor + global_data + level;
}

/// Two by two blocks: the first with endpoint 1 and selector 0, the second like its left neighbour with selector 1; in
/// the lower row the first takes the endpoint from above, the second the one two further on; both use the selector of
/// the history's front. With channels, the same slice is also that of the second one.
std::string small_etc1s(const std::vector<unsigned>& channels = {}) {
  BitWriter endpoints;  // differences to (16, 16, 16), modulo 32
  for (int i = 0; i < 3; ++i) endpoints.flat_table(32, 5);
  endpoints.flat_table(8, 3);
  endpoints.number(0, 1);
  // Colours (31, 0, 16) with table 2, (4, 4, 4) with table 0, (10, 20, 30) with table 7.
  for (const auto& delta : {std::array<std::uint32_t, 4>{2, 15, 16, 0}, {6, 5, 4, 20}, {7, 6, 16, 26}}) {
    endpoints.code(delta[0], 3);
    for (std::size_t c = 1; c < 4; ++c) endpoints.code(delta[c], 5);
  }
  BitWriter selectors;
  selectors.number(0, 2);
  selectors.number(1, 1);
  for (const std::uint32_t row : {0xE4U, 0xE4U, 0xE4U, 0xE4U}) selectors.number(row, 8);  // 0 1 2 3 from left to right
  for (const std::uint32_t row : {0x00U, 0x55U, 0xAAU, 0xFFU}) selectors.number(row, 8);  // 0 1 2 3 from top to bottom
  BitWriter tables;
  tables.flat_table(257, 9);
  tables.flat_table(3, 2);
  tables.flat_table(2 + 4 + 1, 3);
  tables.flat_table(64, 6);
  tables.number(4, 13);
  BitWriter slice;
  slice.code(3 | 0 << 2 | 1 << 4 | 3 << 6, 9);  // predictions of the four blocks
  slice.code(1, 2);                             // endpoint 0 + 1
  slice.code(0, 3);                             // selector 0
  slice.code(1, 3);                             // selector 1
  // History of four entries: new ones go to its rear half, places 2 and 3; the first one stands at 2.
  slice.code(2 + 2, 3);  // selector 0, which moves to place 1
  slice.code(2, 2);      // endpoint 1 + 2 of 3: 0
  slice.code(2 + 3, 3);  // selector 1
  const std::string global =
      base::test_support::to_raw_bytes<std::uint16_t>({3, 2}) +
      base::test_support::to_raw_bytes<std::uint32_t>(
          {static_cast<std::uint32_t>(endpoints.bytes().size()), static_cast<std::uint32_t>(selectors.bytes().size()),
           static_cast<std::uint32_t>(tables.bytes().size()), 0, 0, 0, static_cast<std::uint32_t>(slice.bytes().size()),
           0, static_cast<std::uint32_t>(channels.empty() ? 0 : slice.bytes().size())}) +
      endpoints.bytes() + selectors.bytes() + tables.bytes();
  return header(0, 7, 8, 1, 163, global, slice.bytes(), channels);
}

Rgb8 texel(const std::array<int, 3>& five_bits, int modifier) {
  Rgb8 out;
  for (std::size_t c = 0; c < 3; ++c) {
    out[c] = static_cast<std::uint8_t>(std::clamp((five_bits[c] << 3 | five_bits[c] >> 2) + modifier, 0, 255));
  }
  return out;
}

TEST(Ktx2, ASmallEtc1sTexture) {
  const RgbImage image = decode_ktx2(base::test_support::to_bytes(small_etc1s()), "k", kPixels);
  ASSERT_EQ(image.width, 7);
  ASSERT_EQ(image.height, 8);
  const std::array<int, 4> table0 = {-8, -2, 2, 8};
  const std::array<int, 4> table2 = {-29, -9, 9, 29};
  for (int y = 0; y < 4; ++y) {
    for (int x = 0; x < 7; ++x) {
      const auto across = static_cast<std::size_t>(x % 4);
      const auto down = static_cast<std::size_t>(y);
      EXPECT_EQ(image(x, y), texel({4, 4, 4}, table0[x < 4 ? across : down])) << x << " " << y;
      EXPECT_EQ(image(x, 4 + y), x < 4 ? texel({4, 4, 4}, table0[across]) : texel({31, 0, 16}, table2[down]));
    }
  }
}

TEST(Ktx2, PlainPixels) {
  const std::string pixels = {1, 2, 3, 4, 5, 6, 7, 8};
  const std::string rgba = header(43, 2, 1, 0, 1, "", pixels);
  EXPECT_EQ(decode_ktx2(base::test_support::to_bytes(rgba), "k", kPixels).pixels,
            (std::vector<Rgb8>{{1, 2, 3}, {5, 6, 7}}));
  std::string packed(64, '\0');
  packed.resize(ZSTD_compress(packed.data(), packed.size(), pixels.data(), 6, 3));
  const std::string rgb = header(23, 1, 2, 2, 1, "", packed);
  EXPECT_EQ(decode_ktx2(base::test_support::to_bytes(rgb), "k", kPixels).pixels,
            (std::vector<Rgb8>{{1, 2, 3}, {4, 5, 6}}));
}

TEST(Ktx2, UastcPlainAndInZstandard) {
  std::string block(16, '\0');  // mode 8: the code 10111, then the colour (0x12, 0x34, 0x56)
  const std::uint32_t bits = 0b10111U | 0x12U << 5U | 0x34U << 13U | 0x56U << 21U;
  for (std::size_t i = 0; i < 4; ++i) block[i] = static_cast<char>(bits >> (8 * i));
  const std::vector<Rgb8> expected(6, Rgb8{0x12, 0x34, 0x56});
  EXPECT_EQ(decode_ktx2(base::test_support::to_bytes(header(0, 3, 2, 0, 166, "", block)), "k", kPixels).pixels,
            expected);
  std::string packed(64, '\0');
  packed.resize(ZSTD_compress(packed.data(), packed.size(), block.data(), block.size(), 3));
  EXPECT_EQ(decode_ktx2(base::test_support::to_bytes(header(0, 3, 2, 2, 166, "", packed)), "k", kPixels).pixels,
            expected);
}

std::vector<std::uint8_t> alpha_of(const std::string& file) {
  return decode_ktx2_alpha(to_bytes(file), "k", kPixels).pixels;
}

constexpr unsigned kEtc1sRgb = 0;
constexpr unsigned kEtc1sGgg = 4;
constexpr unsigned kEtc1sAaa = 15;

TEST(Ktx2, AlphaOfEtc1sIsASliceOfItsOwn) {
  const std::string file = small_etc1s({kEtc1sRgb, kEtc1sAaa});
  const RgbImage image = decode_ktx2(to_bytes(file), "k", kPixels);
  const GrayImage alpha = decode_ktx2_alpha(to_bytes(file), "k", kPixels);
  ASSERT_EQ(alpha.width, 7);
  ASSERT_EQ(alpha.height, 8);
  for (std::size_t i = 0; i < image.pixels.size(); ++i) EXPECT_EQ(alpha.pixels[i], image.pixels[i][1]);
  EXPECT_THAT(alpha_of(small_etc1s()), IsEmpty());
  EXPECT_THAT(alpha_of(small_etc1s({3, kEtc1sGgg})), IsEmpty()) << "the second channel of a normal map";
}

TEST(Ktx2, AlphaOfPlainPixels) {
  EXPECT_EQ(alpha_of(header(43, 2, 1, 0, 1, "", {1, 2, 3, 4, 5, 6, 7, 8})), (std::vector<std::uint8_t>{4, 8}));
  EXPECT_THAT(alpha_of(header(23, 1, 2, 0, 1, "", {1, 2, 3, 4, 5, 6})), IsEmpty());
}

TEST(Ktx2, AlphaOfUastc) {
  std::string block(16, '\0');  // mode 8: the code 10111, then the colour (0x12, 0x34, 0x56, 0x78)
  const std::uint64_t bits = 0b10111U | 0x12ULL << 5U | 0x34ULL << 13U | 0x56ULL << 21U | 0x78ULL << 29U;
  for (std::size_t i = 0; i < 8; ++i) block[i] = static_cast<char>(bits >> (8 * i));
  const std::vector<std::uint8_t> expected(6, 0x78);
  EXPECT_EQ(alpha_of(header(0, 3, 2, 0, 166, "", block)), expected);
  EXPECT_EQ(alpha_of(header(0, 3, 2, 0, 166, "", block, {3})), expected);
  EXPECT_THAT(alpha_of(header(0, 3, 2, 0, 166, "", block, {0})), IsEmpty()) << "RGB";
  EXPECT_THAT(alpha_of(header(0, 3, 2, 0, 166, "", block, {5})), IsEmpty()) << "RRRG, of a normal map";
}

TEST(Ktx2, FaultsOfAlphaAreNamed) {
  const std::string good = small_etc1s({kEtc1sRgb, kEtc1sAaa});
  EXPECT_THAT(error_of([&] { decode_ktx2_alpha(to_bytes(good), "k", 10); }), HasSubstr("more than the limit of 10"));
  for (std::size_t length = 12; length < good.size(); ++length)
    EXPECT_NE(error_of([&] { alpha_of(good.substr(0, length)); }), "") << length;
  EXPECT_THAT(error_of([&] { alpha_of(header(0, 4, 4, 0, 166, "", "")); }), HasSubstr("fewer pixels"));
}

TEST(Ktx2, FaultsAreNamed) {
  const std::string good = small_etc1s();
  EXPECT_THAT(base::test_support::error_of([&] { decode_ktx2(base::test_support::to_bytes(good), "k", 10); }),
              HasSubstr("more than the limit of 10"));
  EXPECT_THAT(base::test_support::error_of([&] { decode_ktx2(base::test_support::to_bytes(good), "k", kPixels, 1); }),
              HasSubstr("no level 1"));
  EXPECT_THAT(base::test_support::error_of(
                  [&] { decode_ktx2(base::test_support::to_bytes(header(0, 4, 4, 0, 166, "", "")), "k", kPixels); }),
              HasSubstr("fewer pixels than its header declares"));
  EXPECT_THAT(base::test_support::error_of(
                  [&] { decode_ktx2(base::test_support::to_bytes(header(131, 4, 4, 0, 128, "", "")), "k", kPixels); }),
              HasSubstr("Vulkan format 131"));
  for (std::size_t length = 12; length < good.size(); ++length) {
    EXPECT_NE(base::test_support::error_of(
                  [&] { decode_ktx2(base::test_support::to_bytes(good.substr(0, length)), "k", kPixels); }),
              "")
        << length;
  }
  std::mt19937 random(5);
  for (int i = 0; i < 2000; ++i) {
    std::string damaged = good;
    for (int k = 0; k < 3; ++k) damaged[random() % damaged.size()] = static_cast<char>(random());
    EXPECT_THAT(
        base::test_support::error_of([&] { decode_texture(base::test_support::to_bytes(damaged), "k", kPixels); }),
        Not(HasSubstr("\n")));
  }
}

double rms(const RgbImage& a, const RgbImage& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.pixels.size(); ++i) {
    for (std::size_t c = 0; c < 3; ++c) sum += std::pow(a.pixels[i][c] - b.pixels[i][c], 2);
  }
  return std::sqrt(sum / (3.0 * static_cast<double>(a.pixels.size())));
}

RgbImage halved(const RgbImage& image) {
  RgbImage out(image.width / 2, image.height / 2);
  for (int y = 0; y < out.height; ++y) {
    for (int x = 0; x < out.width; ++x) {
      for (std::size_t c = 0; c < 3; ++c) {
        const int sum = image(2 * x, 2 * y)[c] + image(2 * x + 1, 2 * y)[c] + image(2 * x, 2 * y + 1)[c] +
                        image(2 * x + 1, 2 * y + 1)[c];
        out(x, y)[c] = static_cast<std::uint8_t>(sum / 4);
      }
    }
  }
  return out;
}

/// Pearson's correlation of a channel's grey values: insensitive to sharpness and brightness.
double correlation(const RgbImage& a, const RgbImage& b, std::size_t channel) {
  const auto n = static_cast<double>(a.pixels.size());
  double sum_a = 0;
  double sum_b = 0;
  double aa = 0;
  double bb = 0;
  double ab = 0;
  for (std::size_t i = 0; i < a.pixels.size(); ++i) {
    const double x = a.pixels[i][channel];
    const double y = b.pixels[i][channel];
    sum_a += x;
    sum_b += y;
    aa += x * x;
    bb += y * y;
    ab += x * y;
  }
  return (ab - sum_a * sum_b / n) / std::sqrt((aa - sum_a * sum_a / n) * (bb - sum_b * sum_b / n));
}

double least_correlation(const RgbImage& a, const RgbImage& b) {
  return std::min({correlation(a, b, 0), correlation(a, b, 1), correlation(a, b, 2)});
}

/// Encoded from the photograph in the same folder. Encoders' levels are sharper than means of four pixels.
TEST(Ktx2, RealUastcPicturesAreThePhotographThatTheyWereMadeFrom) {
  TILEFLIGHT_REQUIRE_TEST_DATA(folder, "tilesets/cesium_native_testdata/CesiumImage/test/data/ktx2");
  const RgbImage photograph = read_rgb(folder / "kota.jpg");
  const auto level = [&](const char* file, std::uint32_t number) {
    return decode_ktx2(base::read_bytes(folder / file), file, kPixels, number);
  };
  const RgbImage one_level = level("kota-onelevel.ktx2", 0);
  EXPECT_LT(rms(one_level, photograph), 4);
  EXPECT_GT(least_correlation(one_level, photograph), 0.997);
  EXPECT_EQ(level("kota-automipmap.ktx2", 0).pixels, one_level.pixels);
  EXPECT_EQ(level("kota-mipmaps.ktx2", 0).pixels, one_level.pixels);
  RgbImage coarse = photograph;
  for (std::uint32_t number = 1; coarse.width > 16; ++number) {
    coarse = halved(coarse);
    EXPECT_GT(least_correlation(level("kota-mipmaps.ktx2", number), coarse), 0.97) << "level " << number;
  }
}

/// The levels of a real texture were made from one image, so each resembles the next one downsampled. A single wrongly
/// read bit turns all that follows into noise.
TEST(Ktx2, LevelsOfRealTexturesAgreeAndThoseOfADamagedOneDoNot) {
  TILEFLIGHT_REQUIRE_TEST_DATA(folder, "tilesets/matterport_cedarcreek_ktx2/mesh_tiles");
  for (const char* file : {"1/lod1_room5_chunk0_000.ktx2", "3/lod3_room5_chunk0_000.ktx2"}) {
    std::vector<std::byte> bytes = base::read_bytes(folder / file);
    RgbImage finer = decode_ktx2(bytes, file, 1 << 26);
    EXPECT_GE(finer.width, 256);
    for (std::uint32_t level = 1; finer.width > 64; ++level) {
      const RgbImage coarser = decode_ktx2(bytes, file, 1 << 26, level);
      ASSERT_EQ(coarser.width, finer.width / 2);
      EXPECT_GT(least_correlation(halved(finer), coarser), 0.9) << file << " level " << level;
      finer = coarser;
    }
    std::uint64_t finest_at = 0;
    std::memcpy(&finest_at, bytes.data() + 80, sizeof(finest_at));
    bytes[static_cast<std::size_t>(finest_at) + 100] ^= std::byte{4};
    const auto likeness = [&] {
      return least_correlation(halved(decode_ktx2(bytes, file, 1 << 26)), decode_ktx2(bytes, file, 1 << 26, 1));
    };
    double damaged = 0;
    EXPECT_THAT(base::test_support::error_of([&] { damaged = likeness(); }),
                AnyOf(IsEmpty(), HasSubstr("outside the image")));
    EXPECT_LT(damaged, 0.5) << file;
  }
}

}  // namespace
}  // namespace tileflight::imaging::ktx2_test
