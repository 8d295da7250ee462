#include "tileflight/core/imaging/exr_channels.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "tests/temporary_folder.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/imaging/image_files.h"

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
