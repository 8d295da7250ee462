#include "tileflight/core/imaging/image_files.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tiffio.h>
#include <webp/encode.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <random>

#include "tests/refusal.h"
#include "tests/temporary_folder.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/raw_bytes.h"

namespace tileflight::imaging::image_files_test {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;
using Bytes = std::vector<std::byte>;

/// Smooth colours with some texture, of odd size so that blocks are cut.
RgbImage picture(int width = 61, int height = 43) {
  RgbImage image(width, height);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      const auto wave = [&](double fx, double fy) {
        return static_cast<std::uint8_t>(128 + 100 * std::sin(fx * x) * std::cos(fy * y));
      };
      image(x, y) = {wave(0.1, 0.05), wave(0.07, 0.11), wave(0.03, 0.2)};
    }
  return image;
}

Gray16Image picture16() {
  Gray16Image image(37, 21);
  for (std::size_t i = 0; i < image.pixels.size(); ++i) image.pixels[i] = static_cast<std::uint16_t>(i * 84 + 3);
  return image;
}

Bytes encode_webp(const RgbImage& image) {
  std::uint8_t* encoded = nullptr;
  const std::size_t size =
      WebPEncodeLosslessRGB(image.pixels.data()->data(), image.width, image.height, 3 * image.width, &encoded);
  const auto* begin = reinterpret_cast<const std::byte*>(encoded);
  Bytes bytes(begin, begin + size);
  WebPFree(encoded);
  return bytes;
}

double psnr(const RgbImage& a, const RgbImage& b) {
  double sum = 0.0;
  for (std::size_t i = 0; i < a.pixels.size(); ++i)
    for (int c = 0; c < 3; ++c) sum += std::pow(a.pixels[i][c] - b.pixels[i][c], 2);
  return 10.0 * std::log10(255.0 * 255.0 * 3.0 * a.pixels.size() / std::max(sum, 1e-9));
}

TEST(ImageFiles, PngIsLossless) {
  const RgbImage image = picture();
  EXPECT_EQ(decode_rgb(encode_png(image), "a").pixels, image.pixels);
  EXPECT_EQ(decode_rgb(encode_png(image, PngEffort::kLittleTime), "a").pixels, image.pixels);
  const GrayImage gray = to_gray(image);
  EXPECT_EQ(decode_gray(encode_png(gray), "a").pixels, gray.pixels);
  EXPECT_EQ(decode_rgb(encode_png(gray), "a").pixels, to_rgb(gray).pixels);
  EXPECT_EQ(decode_gray(encode_png(image), "a").pixels, gray.pixels);
}

TEST(ImageFiles, SixteenBitPng) {
  tests::TemporaryFolder folder;
  const Gray16Image image = picture16();
  const Bytes bytes = encode_png(image);
  base::write_file(folder / "a.png", {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
  const Gray16Image back = read_gray16(folder / "a.png");
  EXPECT_EQ(back.pixels, image.pixels);
  EXPECT_EQ(back.width, image.width);
  const GrayImage eight = read_gray(folder / "a.png");
  for (std::size_t i = 0; i < image.pixels.size(); ++i) EXPECT_NEAR(eight.pixels[i], image.pixels[i] / 257.0, 0.51);
}

TEST(ImageFiles, EightBitsWidenToSixteen) {
  tests::TemporaryFolder folder;
  GrayImage image(256, 1);
  for (int x = 0; x < 256; ++x) image(x, 0) = static_cast<std::uint8_t>(x);
  write_gray(folder / "a.png", image);
  const Gray16Image wide = read_gray16(folder / "a.png");
  for (int x = 0; x < 256; ++x) EXPECT_EQ(wide(x, 0), 257 * x);
}

TEST(ImageFiles, JpegKeepsThePicture) {
  const RgbImage image = picture();
  const RgbImage back = decode_rgb(encode_jpeg(image, 95), "a");
  ASSERT_EQ(back.width, image.width);
  ASSERT_EQ(back.height, image.height);
  EXPECT_GT(psnr(image, back), 40.0);
  EXPECT_GT(psnr(image, decode_rgb(encode_jpeg(image, 75), "a")), 32.0);
  EXPECT_LT(encode_jpeg(image, 75).size(), encode_jpeg(image, 95).size());
}

TEST(ImageFiles, JpegChromaIsFullFromQuality90) {
  // Red and blue columns in turn: halved chroma would blend them.
  RgbImage stripes(32, 32);
  for (int y = 0; y < 32; ++y)
    for (int x = 0; x < 32; ++x) stripes(x, y) = x % 2 == 0 ? Rgb8{200, 40, 40} : Rgb8{40, 40, 200};
  EXPECT_GT(psnr(stripes, decode_rgb(encode_jpeg(stripes, 90), "a")), 25.0);
  EXPECT_LT(psnr(stripes, decode_rgb(encode_jpeg(stripes, 89), "a")), 15.0);
}

TEST(ImageFiles, GrayOfAColourJpegIsItsLuma) {
  const RgbImage image = picture();
  const Bytes bytes = encode_jpeg(image, 95);
  const GrayImage gray = decode_gray(bytes, "a");
  const GrayImage through_rgb = to_gray(decode_rgb(bytes, "a"));
  for (std::size_t i = 0; i < gray.pixels.size(); ++i) EXPECT_NEAR(gray.pixels[i], through_rgb.pixels[i], 2);
}

TEST(ImageFiles, SamePixelsSameBytes) {
  EXPECT_EQ(encode_jpeg(picture(), 85), encode_jpeg(picture(), 85));
  EXPECT_EQ(encode_png(picture()), encode_png(picture()));
}

TEST(ImageFiles, WebpIsRead) {
  const RgbImage image = picture();
  EXPECT_EQ(decode_rgb(encode_webp(image), "a").pixels, image.pixels);
  EXPECT_EQ(decode_gray(encode_webp(image), "a").pixels, to_gray(image).pixels);
}

TEST(ImageFiles, WrittenByEnding) {
  tests::TemporaryFolder folder;
  const RgbImage image = picture();
  write_rgb(folder / "a.png", image);
  write_rgb(folder / "a.JPG", image);
  write_gray(folder / "g.jpeg", to_gray(image));
  EXPECT_EQ(read_rgb(folder / "a.png").pixels, image.pixels);
  EXPECT_GT(psnr(read_rgb(folder / "a.JPG"), image), 40.0);
  EXPECT_EQ(read_gray(folder / "g.jpeg").width, image.width);
  EXPECT_THAT(tests::refusal_of([&] { write_rgb(folder / "a.bmp", image); }), HasSubstr("a.bmp"));
}

TEST(ImageFiles, EveryTruncationIsAnError) {
  const RgbImage image = picture();
  for (const Bytes& whole : {encode_jpeg(image, 90), encode_png(image), encode_png(picture16()), encode_webp(image)}) {
    for (std::size_t size = 0; size < whole.size() - 1; size += 1 + size / 16) {
      const Bytes part(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(size));
      EXPECT_THAT([&] { decode_rgb(part, "part"); }, ThrowsMessage<InputError>(HasSubstr("part: ")))
          << size << " of " << whole.size();
      EXPECT_THAT([&] { decode_gray(part, "part"); }, ThrowsMessage<InputError>(HasSubstr("part: ")))
          << size << " of " << whole.size();
    }
  }
}

TEST(ImageFiles, TruncatedJpegIsNotAGreyHalf) {
  Bytes bytes = encode_jpeg(picture(400, 300), 90);
  bytes.resize(bytes.size() / 2);
  EXPECT_THAT(tests::refusal_of([&] { decode_rgb(bytes, "photo.jpg"); }),
              testing::AllOf(HasSubstr("photo.jpg"), HasSubstr("truncated")));
}

TEST(ImageFiles, DamagedBytesAreAnErrorOrAnImage) {
  std::mt19937 random(3);
  const RgbImage image = picture();
  for (const Bytes& whole : {encode_jpeg(image, 90), encode_png(image), encode_webp(image)}) {
    for (int i = 0; i < 300; ++i) {
      Bytes damaged = whole;
      for (int flips = 0; flips < 4; ++flips) damaged[random() % damaged.size()] = static_cast<std::byte>(random());
      try {
        const RgbImage read = decode_rgb(damaged, "damaged", {1 << 20});
        EXPECT_EQ(read.pixels.size(), static_cast<std::size_t>(read.width) * read.height);
      } catch (const InputError&) {
      }
    }
  }
}

void put_big_endian(Bytes& bytes, std::size_t at, std::uint32_t value, int count) {
  for (int i = 0; i < count; ++i) bytes[at + i] = static_cast<std::byte>(value >> (8 * (count - 1 - i)));
}

std::uint32_t crc32_of(std::span<const std::byte> bytes) {
  std::uint32_t crc = 0xFFFFFFFF;
  for (const std::byte byte : bytes) {
    crc ^= static_cast<std::uint32_t>(byte);
    for (int bit = 0; bit < 8; ++bit) crc = (crc >> 1) ^ ((crc & 1U) != 0 ? 0xEDB88320U : 0U);
  }
  return ~crc;
}

TEST(ImageFiles, HugeHeadersAreRefusedBeforeAllocation) {
  Bytes png = encode_png(picture());
  put_big_endian(png, 16, 900000, 4);  // IHDR: width, height
  put_big_endian(png, 20, 900000, 4);
  put_big_endian(png, 29, crc32_of(std::span(png).subspan(12, 17)), 4);
  EXPECT_THAT(tests::refusal_of([&] { decode_rgb(png, "big.png"); }), HasSubstr("900000x900000"));

  Bytes jpeg = encode_jpeg(picture(), 90);
  const std::array<std::byte, 2> frame_marker{std::byte{0xFF}, std::byte{0xC0}};
  const auto frame = std::search(jpeg.begin(), jpeg.end(), frame_marker.begin(), frame_marker.end());
  put_big_endian(jpeg, static_cast<std::size_t>(frame - jpeg.begin()) + 5, 65500, 2);
  put_big_endian(jpeg, static_cast<std::size_t>(frame - jpeg.begin()) + 7, 65500, 2);
  EXPECT_THAT(tests::refusal_of([&] { decode_rgb(jpeg, "big.jpg"); }), HasSubstr("65500x65500"));

  EXPECT_THAT(tests::refusal_of([&] { decode_rgb(encode_webp(picture()), "big.webp", {1000}); }), HasSubstr("61x43"));
}

TEST(ImageFiles, OtherFilesAreNamed) {
  tests::TemporaryFolder folder;
  base::write_file(folder / "a.jpg", "this is text");
  EXPECT_THAT(tests::refusal_of([&] { read_rgb(folder / "a.jpg"); }), HasSubstr("not a JPEG, PNG, WebP, TIFF"));
  base::write_file(folder / "b.jpg", "");
  EXPECT_THAT(tests::refusal_of([&] { read_rgb(folder / "b.jpg"); }), HasSubstr("empty"));
  EXPECT_THAT(tests::refusal_of([&] { read_rgb(folder / "none.jpg"); }), HasSubstr("none.jpg"));
}

TEST(Exr, RoundTripKeepsEveryBit) {
  tests::TemporaryFolder folder;
  FloatImage depth(53, 31);
  for (std::size_t i = 0; i < depth.pixels.size(); ++i) depth.pixels[i] = 0.1F * static_cast<float>(i) + 1.0F / 3.0F;
  depth(3, 4) = std::numeric_limits<float>::infinity();
  depth(5, 6) = std::numeric_limits<float>::quiet_NaN();
  write_exr(folder / "a.exr", depth);
  const FloatImage back = read_exr(folder / "a.exr");
  ASSERT_EQ(back.width, depth.width);
  ASSERT_EQ(back.height, depth.height);
  EXPECT_EQ(std::memcmp(back.pixels.data(), depth.pixels.data(), depth.pixels.size() * sizeof(float)), 0);
  write_exr(folder / "b.exr", depth);
  EXPECT_EQ(base::read_bytes(folder / "a.exr"), base::read_bytes(folder / "b.exr"));
}

TEST(Exr, AnOnlyChannelOfAnotherNameIsRead) {
  tests::TemporaryFolder folder;
  write_exr(folder / "a.exr", FloatImage(4, 3, 2.5F), "range");
  EXPECT_EQ(read_exr(folder / "a.exr").pixels, std::vector<float>(12, 2.5F));
}

TEST(Exr, TruncatedDamagedAndHuge) {
  tests::TemporaryFolder folder;
  FloatImage noise(40, 60);
  std::mt19937 random(2);
  for (float& value : noise.pixels) value = static_cast<float>(random());
  write_exr(folder / "a.exr", noise);
  const std::string whole = base::read_text(folder / "a.exr");
  for (std::size_t size = 0; size < whole.size() - 1; size += 1 + size / 8) {
    base::write_file(folder / "part.exr", whole.substr(0, size));
    EXPECT_THAT(tests::refusal_of([&] { read_exr(folder / "part.exr"); }), HasSubstr("part.exr")) << size;
  }
  for (int i = 0; i < 300; ++i) {
    std::string damaged = whole;
    for (int flips = 0; flips < 3; ++flips) damaged[random() % 400] = static_cast<char>(random());
    base::write_file(folder / "damaged.exr", damaged);
    try {
      EXPECT_FALSE(read_exr(folder / "damaged.exr").empty());
    } catch (const InputError&) {
    }
  }
  // dataWindow: name, type, size 16, then min x, min y, max x, max y (little endian).
  std::string huge = whole;
  const std::size_t window = huge.find("dataWindow") + sizeof("dataWindow") + sizeof("box2i") + 4;
  huge.replace(window + 8, 8, std::string("\xFF\xFF\xFF\x3F\xFF\xFF\xFF\x3F"));
  base::write_file(folder / "huge.exr", huge);
  EXPECT_THAT(tests::refusal_of([&] { read_exr(folder / "huge.exr"); }), HasSubstr("1073741824x1073741824"));
}

/// A TIFF as libtiff writes it: LZW, strips of 5 rows.
Bytes encode_tiff(const tests::TemporaryFolder& folder, const void* pixels, int width, int height, int bits,
                  int samples, int format = SAMPLEFORMAT_UINT) {
  const std::string file = folder / "made.tif";
  TIFF* tiff = TIFFOpen(file.c_str(), "w");
  TIFFSetField(tiff, TIFFTAG_IMAGEWIDTH, width);
  TIFFSetField(tiff, TIFFTAG_IMAGELENGTH, height);
  TIFFSetField(tiff, TIFFTAG_BITSPERSAMPLE, bits);
  TIFFSetField(tiff, TIFFTAG_SAMPLESPERPIXEL, samples);
  TIFFSetField(tiff, TIFFTAG_SAMPLEFORMAT, format);
  TIFFSetField(tiff, TIFFTAG_PLANARCONFIG, PLANARCONFIG_CONTIG);
  TIFFSetField(tiff, TIFFTAG_PHOTOMETRIC, samples == 1 ? PHOTOMETRIC_MINISBLACK : PHOTOMETRIC_RGB);
  TIFFSetField(tiff, TIFFTAG_COMPRESSION, COMPRESSION_LZW);
  TIFFSetField(tiff, TIFFTAG_ROWSPERSTRIP, 5);
  const auto* bytes = static_cast<const std::uint8_t*>(pixels);
  const std::size_t row_bytes = static_cast<std::size_t>(width) * static_cast<std::size_t>(samples * bits / 8);
  std::vector<std::uint8_t> row(row_bytes);
  for (int y = 0; y < height; ++y) {
    std::copy_n(bytes + static_cast<std::size_t>(y) * row_bytes, row_bytes, row.begin());
    TIFFWriteScanline(tiff, row.data(), static_cast<std::uint32_t>(y));
  }
  TIFFClose(tiff);
  return base::read_bytes(file);
}

TEST(ImageFiles, TiffKeepsItsPixels) {
  const tests::TemporaryFolder folder;
  const RgbImage color = picture();
  EXPECT_EQ(decode_rgb(encode_tiff(folder, color.pixels.data(), color.width, color.height, 8, 3), "t").pixels,
            color.pixels);
  const GrayImage gray = to_gray(color);
  EXPECT_EQ(decode_gray(encode_tiff(folder, gray.pixels.data(), gray.width, gray.height, 8, 1), "t").pixels,
            gray.pixels);
  const Gray16Image wide = picture16();
  const Bytes bytes = encode_tiff(folder, wide.pixels.data(), wide.width, wide.height, 16, 1);
  EXPECT_EQ(read_gray16(folder / "made.tif").pixels, wide.pixels);
  EXPECT_EQ(decode_gray(bytes, "t").pixels.back(), (wide.pixels.back() * 255U + 32767U) / 65535U);
  base::write_file(folder / "again.png", base::as_text(recode_png(bytes, "t")));
  EXPECT_EQ(read_gray16(folder / "again.png").pixels, wide.pixels);
}

TEST(ImageFiles, BadTiffsAreOneClearLine) {
  const tests::TemporaryFolder folder;
  const RgbImage color = picture();
  Bytes bytes = encode_tiff(folder, color.pixels.data(), color.width, color.height, 8, 3);
  EXPECT_THAT(tests::refusal_of([&] { decode_rgb(bytes, "t", {100}); }), HasSubstr("larger than the limit"));
  bytes.resize(bytes.size() / 2);
  EXPECT_THAT(tests::refusal_of([&] { decode_rgb(bytes, "t"); }), HasSubstr("t: "));
  const std::vector<float> numbers(12, 1.0F);
  EXPECT_THAT(tests::refusal_of(
                  [&] { decode_rgb(encode_tiff(folder, numbers.data(), 4, 3, 32, 1, SAMPLEFORMAT_IEEEFP), "t"); }),
              HasSubstr("is a TIFF of 32-bit numbers"));
}

/// A BMP of 3x2 pixels, rows from below, 24 bits: red, green, blue; white, black, grey.
std::string small_bmp() {
  using namespace std::string_literals;
  return "BM\x4E\0\0\0\0\0\0\0\x36\0\0\0\x28\0\0\0\3\0\0\0\2\0\0\0\1\0\x18\0"s + std::string(24, '\0') +
         "\xFF\xFF\xFF\0\0\0\x80\x80\x80\0\0\0"s + "\0\0\xFF\0\xFF\0\xFF\0\0\0\0\0"s;
}

Bytes bytes_of(const std::string& text) {
  const auto* begin = reinterpret_cast<const std::byte*>(text.data());
  return {begin, begin + text.size()};
}

TEST(ImageFiles, BmpRowsComeFromBelow) {
  const RgbImage image = decode_rgb(bytes_of(small_bmp()), "b");
  ASSERT_EQ(image.width, 3);
  ASSERT_EQ(image.height, 2);
  EXPECT_EQ(image(0, 0), (Rgb8{255, 0, 0}));
  EXPECT_EQ(image(2, 0), (Rgb8{0, 0, 255}));
  EXPECT_EQ(image(2, 1), (Rgb8{128, 128, 128}));
  EXPECT_THAT(tests::refusal_of([] { decode_rgb(bytes_of(small_bmp().substr(0, 70)), "b"); }), HasSubstr("truncated"));
  std::string packed = small_bmp();
  packed[30] = 1;
  EXPECT_THAT(tests::refusal_of([&] { decode_rgb(bytes_of(packed), "b"); }), HasSubstr("save it as PNG"));
}

TEST(ImageFiles, PnmOfEachKindIsRead) {
  EXPECT_EQ(decode_gray(bytes_of("P2 # made by hand\n3 1\n15\n0 5 15\n"), "p").pixels,
            (std::vector<std::uint8_t>{0, 85, 255}));
  EXPECT_EQ(decode_gray(bytes_of("P5\n3 1\n255\nABC"), "p").pixels, (std::vector<std::uint8_t>{65, 66, 67}));
  EXPECT_EQ(decode_rgb(bytes_of("P6 1 1 255\nABC"), "p").pixels, (std::vector<Rgb8>{{65, 66, 67}}));
  EXPECT_EQ(decode_rgb(bytes_of("P3 1 1 255\n1 2 3"), "p").pixels, (std::vector<Rgb8>{{1, 2, 3}}));
  EXPECT_THAT(tests::refusal_of([] { decode_gray(bytes_of("P5\n3 2\n255\nABC"), "p"); }), HasSubstr("truncated"));
  EXPECT_THAT(tests::refusal_of([] { decode_gray(bytes_of("P2\n30000 20000\n255\n1"), "p"); }), HasSubstr("p: "));
  EXPECT_THAT(tests::refusal_of([] { decode_gray(bytes_of("%PDF-1.4"), "p"); }),
              HasSubstr("is a PDF, not a JPEG, PNG"));
}

}  // namespace
}  // namespace tileflight::imaging::image_files_test

namespace tileflight::imaging::exr_channels_test {
namespace {

using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

TEST(ExrChannels, ComeBackBitByBit) {
  const tests::TemporaryFolder folder;
  Image<std::array<float, 3>> image(17, 11);
  for (int y = 0; y < 11; ++y) {
    for (int x = 0; x < 17; ++x) image(x, y) = {0.1F * static_cast<float>(x), -1e-20F * static_cast<float>(y), 7.0F};
  }
  image(3, 2) = {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity(), -0.0F};
  write_exr_channels<3>(folder / "a.exr", image, {"R", "G", "B"});
  const FloatImage red = read_exr_channel(folder / "a.exr", "R");
  const FloatImage green = read_exr_channel(folder / "a.exr", "G");
  const FloatImage blue = read_exr_channel(folder / "a.exr", "B");
  for (int y = 0; y < 11; ++y) {
    for (int x = 0; x < 17; ++x) {
      if (x == 3 && y == 2) continue;
      EXPECT_EQ(red(x, y), image(x, y)[0]);
      EXPECT_EQ(green(x, y), image(x, y)[1]);
      EXPECT_EQ(blue(x, y), image(x, y)[2]);
    }
  }
  EXPECT_TRUE(std::isnan(red(3, 2)));
  EXPECT_EQ(green(3, 2), std::numeric_limits<float>::infinity());
  EXPECT_TRUE(std::signbit(blue(3, 2)));
}

TEST(ExrChannels, OneThatIsNotThereIsNamed) {
  const tests::TemporaryFolder folder;
  write_exr(folder / "a.exr", FloatImage(4, 3, 2.0F), "Y");
  EXPECT_EQ(read_exr(folder / "a.exr")(3, 2), 2.0F);  // the only one
  EXPECT_THAT([&] { read_exr_channel(folder / "a.exr", "R"); },
              ThrowsMessage<InputError>(HasSubstr("a.exr: has no channel R")));
}

}  // namespace
}  // namespace tileflight::imaging::exr_channels_test
