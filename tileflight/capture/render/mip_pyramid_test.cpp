#include "tileflight/capture/render/mip_pyramid.h"

#include <gtest/gtest.h>

#include "tileflight/capture/render/linear_color.h"
#include "tileflight/capture/render/test_scenes.h"

namespace tileflight::render::mip_pyramid_test {
namespace {

using imaging::Rgb8;
using test_scenes::grey;
using test_scenes::noise;
using test_scenes::texture;

TEST(MipPyramid, HalvesDownToOneTexel) {
  const MipPyramid pyramid(texture(37, 5, [](int, int) { return grey(80); }));
  ASSERT_EQ(pyramid.levels(), 7);
  const std::vector<std::pair<int, int>> sizes{{37, 5}, {19, 3}, {10, 2}, {5, 1}, {3, 1}, {2, 1}, {1, 1}};
  for (int i = 0; i < pyramid.levels(); ++i) {
    EXPECT_EQ(pyramid.level(i).width, sizes[static_cast<std::size_t>(i)].first);
    EXPECT_EQ(pyramid.level(i).height, sizes[static_cast<std::size_t>(i)].second);
    EXPECT_EQ(pyramid.texel(i, pyramid.level(i).width - 1, 0), grey(80));
  }
}

TEST(MipPyramid, TheFinestLevelIsTheImageItself) {
  const auto image = texture(16, 9, [](int x, int y) { return grey(noise(x, y)); });
  const MipPyramid pyramid(image);
  EXPECT_EQ(static_cast<const void*>(pyramid.level(0).texels), static_cast<const void*>(image->pixels.data()));
  EXPECT_EQ(pyramid.texel(0, 3, 8), (*image)(3, 8));
}

TEST(MipPyramid, AveragesAreOfLinearLightOverTheTexelsArea) {
  for (const auto& [width, height] : {std::pair{64, 32}, {61, 37}}) {
    const auto image = texture(width, height, [](int x, int y) { return grey(noise(x, y)); });
    const MipPyramid pyramid(image);
    double sum = 0.0;
    for (const Rgb8& texel : image->pixels) sum += srgb_decode(texel[0]);
    const double mean = sum / static_cast<double>(image->pixels.size());
    const Rgb8 last = pyramid.texel(pyramid.levels() - 1, 0, 0);
    EXPECT_NEAR(last[0], srgb_encode(mean), 1.5) << width;
  }
  const MipPyramid checker(texture(8, 8, [](int x, int y) { return grey((x + y) % 2 * 255); }));
  EXPECT_EQ(checker.texel(1, 2, 2), grey(static_cast<int>(srgb_encode(0.5) + 0.5)));
}

TEST(MipPyramid, TinyImages) {
  const MipPyramid one(texture(1, 1, [](int, int) { return grey(9); }));
  EXPECT_EQ(one.levels(), 1);
  EXPECT_EQ(one.texel(0, 0, 0), grey(9));
  const MipPyramid two(texture(2, 1, [](int x, int) { return grey(100 * x); }));
  EXPECT_EQ(two.levels(), 2);
  EXPECT_EQ(two.texel(0, 1, 0), grey(100));
}

TEST(MipPyramid, PaddingDoesNotBleedIntoWhatIsShown) {
  // Charts of one grey on a black background: at no level may any part covered by a chart be darker.
  const auto in_chart = [](int x, int y) { return x % 16 < 9 && y % 16 < 6; };
  const auto image = texture(64, 64, [&](int x, int y) { return grey(in_chart(x, y) ? 200 : 0); });
  imaging::GrayImage coverage(64, 64);
  for (int y = 0; y < 64; ++y) {
    for (int x = 0; x < 64; ++x) coverage(x, y) = in_chart(x, y) ? 255 : 0;
  }
  const MipPyramid covered(image, coverage);
  const MipPyramid plain(image);
  for (int level = 1; level < covered.levels(); ++level) {
    const MipLevel& mip = covered.level(level);
    for (int y = 0; y < mip.height; ++y) {
      for (int x = 0; x < mip.width; ++x) {
        if (!in_chart(x << level, y << level)) continue;
        EXPECT_NEAR(covered.texel(level, x, y)[0], 200, 2) << level << " " << x << " " << y;
      }
    }
  }
  EXPECT_LT(plain.texel(plain.levels() - 1, 0, 0)[0], 120);
}

}  // namespace
}  // namespace tileflight::render::mip_pyramid_test
