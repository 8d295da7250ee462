#include "tileflight/imaging/quick_picture.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>

#include "tests/refusal.h"
#include "tileflight/base/input_error.h"

namespace tileflight::imaging::quick_picture_test {
namespace {

RgbImage random_picture(int width, int height) {
  std::mt19937 random(3);
  RgbImage image(width, height);
  for (Rgb8& pixel : image.pixels) {
    for (std::uint8_t& value : pixel) value = static_cast<std::uint8_t>(random() % 40 + 200);
  }
  return image;
}

TEST(QuickPicture, HoldsTheSamePixels) {
  for (const auto& [width, height] : {std::pair(1, 1), std::pair(2, 5), std::pair(11, 3), std::pair(67, 41)}) {
    const RgbImage image = random_picture(width, height);
    const RgbImage read = decode_quick_picture(encode_quick_picture(image), "kept");
    EXPECT_EQ(read.width, width);
    EXPECT_EQ(read.height, height);
    EXPECT_EQ(read.pixels, image.pixels);
  }
}

TEST(QuickPicture, RefusesWhatIsNotWhole) {
  const std::vector<std::byte> whole = encode_quick_picture(random_picture(9, 7));
  for (std::size_t size = 0; size < whole.size(); ++size)
    EXPECT_THROW(decode_quick_picture(std::span(whole).first(size), "kept"), InputError) << size;
  for (std::size_t byte = 0; byte < 16; ++byte) {  // mark and size
    std::vector<std::byte> damaged = whole;
    damaged[byte] ^= std::byte{0x40};
    EXPECT_THROW(decode_quick_picture(damaged, "kept"), InputError) << byte;
  }
  EXPECT_THAT(tests::refusal_of([&] { decode_quick_picture(std::span(whole).first(8), "frames/000001.picture"); }),
              testing::HasSubstr("frames/000001.picture: is no kept picture"));
}

}  // namespace
}  // namespace tileflight::imaging::quick_picture_test
