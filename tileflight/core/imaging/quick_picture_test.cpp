#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>

#include "tests/refusal.h"
#include "tileflight/core/imaging/image_files.h"

namespace tileflight::imaging::quick_picture_test {
namespace {

using ::testing::HasSubstr;

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
  const auto refusal_of = [](std::span<const std::byte> bytes) {
    return tests::refusal_of([&] { decode_quick_picture(bytes, "kept"); });
  };
  constexpr std::size_t kHeader = 16;  // mark and size
  for (std::size_t size = 0; size < whole.size(); ++size) {
    const char* why = size < kHeader    ? "is no kept image"
                      : size == kHeader ? "unpacks to fewer bytes than it should"
                                        : "its Zstandard data are malformed";
    EXPECT_EQ(refusal_of(std::span(whole).first(size)), std::string("kept: ") + why) << size;
  }
  for (std::size_t byte = 0; byte < kHeader; ++byte) {
    std::vector<std::byte> damaged = whole;
    damaged[byte] ^= std::byte{0x40};
    EXPECT_THAT(refusal_of(damaged), testing::AnyOf(HasSubstr("is no kept image"), HasSubstr("declares more bytes"),
                                                    HasSubstr("unpacks to fewer bytes"), HasSubstr("are malformed")))
        << byte;
  }
  EXPECT_THAT(tests::refusal_of([&] { decode_quick_picture(std::span(whole).first(8), "frames/000001.picture"); }),
              HasSubstr("frames/000001.picture: is no kept image"));
}

}  // namespace
}  // namespace tileflight::imaging::quick_picture_test
