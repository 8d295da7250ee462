#include "tileflight/capture/render/mip_pyramid.h"

#include <gtest/gtest.h>

#include <functional>

#include "tileflight/capture/render/linear_color.h"
#include "tileflight/capture/render/test_scenes.h"
#include "tileflight/core/imaging/deferred_texture.h"

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

TEST(MipPyramid, ADeferredTextureIsDecodedOnceAndLooksTheSame) {
  const auto image = texture(61, 37, [](int x, int y) { return grey(noise(x, y)); });
  const auto coverage = [] {
    imaging::GrayImage covered(61, 37, 255);
    for (int x = 0; x < 61; ++x) covered(x, 20) = 0;
    return covered;
  };
  for (const bool padded : {false, true}) {
    int decoded = 0;
    const auto deferred = imaging::make_deferred_texture(61, 37, [&] { return ++decoded, *image; });
    const MipPyramid pyramid(deferred, padded ? coverage : std::function<imaging::GrayImage()>());
    const MipPyramid whole(image, padded ? coverage : std::function<imaging::GrayImage()>());
    EXPECT_EQ(pyramid.levels(), whole.levels());
    EXPECT_EQ(decoded, 0) << "no texel was asked for";
    for (int i = 0; i < whole.levels(); ++i)
      for (int y = 0; y < whole.level(i).height; ++y)
        for (int x = 0; x < whole.level(i).width; ++x) EXPECT_EQ(pyramid.texel(i, x, y), whole.texel(i, x, y));
    EXPECT_EQ(decoded, 1);
  }
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
  const MipPyramid covered(image, [&] { return coverage; });
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

/// The levels by their definition, one texel after the other.
struct Reference {
  std::vector<imaging::RgbImage> levels;

  Reference(const imaging::RgbImage& image, imaging::GrayImage coverage) {
    levels.push_back(image);
    if (!coverage.empty()) dilate(levels[0], coverage);
    while (levels.back().width > 1 || levels.back().height > 1) halve(imaging::RgbImage(levels.back()), coverage);
  }

  static void dilate(imaging::RgbImage& image, const imaging::GrayImage& coverage) {
    const imaging::RgbImage before = image;
    for (int y = 0; y < image.height; ++y) {
      for (int x = 0; x < image.width; ++x) {
        int sum[3] = {}, count = 0;
        for (int j = std::max(0, y - 1); j <= std::min(image.height - 1, y + 1); ++j) {
          for (int i = std::max(0, x - 1); i <= std::min(image.width - 1, x + 1); ++i) {
            if (coverage(i, j) == 0) continue;
            ++count;
            for (std::size_t c = 0; c < 3; ++c) sum[c] += before(i, j)[c];
          }
        }
        for (std::size_t c = 0; c < 3 && count > 0 && coverage(x, y) == 0; ++c)
          image(x, y)[c] = static_cast<std::uint8_t>((sum[c] + count / 2) / count);
      }
    }
  }

  void halve(const imaging::RgbImage& fine, imaging::GrayImage& coverage) {
    imaging::RgbImage coarse((fine.width + 1) / 2, (fine.height + 1) / 2);
    imaging::GrayImage covered =
        coverage.empty() ? imaging::GrayImage() : imaging::GrayImage(coarse.width, coarse.height);
    const double sx = static_cast<double>(fine.width) / coarse.width,
                 sy = static_cast<double>(fine.height) / coarse.height;
    const auto share = [](int i, int j, double scale) {
      const double width = std::min<double>((i + 1) * scale, j + 1) - std::max<double>(i * scale, j);
      return width > 1e-9 ? static_cast<float>(width / scale) : 0.0F;
    };
    for (int y = 0; y < coarse.height; ++y) {
      for (int x = 0; x < coarse.width; ++x) {
        LinearRgb all{}, some{};
        float part = 0.0F;
        for (int j = static_cast<int>(y * sy); j < std::min(fine.height, static_cast<int>(y * sy) + 3); ++j) {
          for (int i = static_cast<int>(x * sx); i < std::min(fine.width, static_cast<int>(x * sx) + 3); ++i) {
            const float weight = share(x, i, sx) * share(y, j, sy);
            const float of_covered =
                coverage.empty() ? weight : weight * (static_cast<float>(coverage(i, j)) * (1.0F / 255.0F));
            part += of_covered;
            for (std::size_t c = 0; c < 3; ++c) {
              const float light = SrgbTables::get().decode(fine(i, j)[c]);
              all[c] += weight * light;
              some[c] += of_covered * light;
            }
          }
        }
        for (std::size_t c = 0; c < 3 && part > 0.0F; ++c) all[c] = some[c] * (1.0F / part);
        coarse(x, y) = SrgbTables::get().encode(all);
        if (!coverage.empty() && part > 0.0F)
          covered(x, y) = static_cast<std::uint8_t>(std::clamp(part * 255.0F + 0.5F, 1.0F, 255.0F));
      }
    }
    if (!coverage.empty()) dilate(coarse, covered);
    coverage = std::move(covered);
    levels.push_back(std::move(coarse));
  }
};

TEST(MipPyramid, LevelsAreThoseOfTheDefinitionToTheByte) {
  for (const auto& [width, height] : {std::pair{64, 32}, {61, 37}, {1, 9}, {2, 2}, {33, 64}}) {
    const auto image = texture(width, height, [](int x, int y) {
      return Rgb8{static_cast<std::uint8_t>(noise(x, y)), static_cast<std::uint8_t>(noise(y, x + 7)),
                  static_cast<std::uint8_t>(noise(x + 3, y))};
    });
    for (const int period : {0, 2, 5, 1000}) {  // 0: no coverage; 1000: hardly any
      imaging::GrayImage coverage;
      if (period > 0) {
        coverage = imaging::GrayImage(width, height);
        for (int y = 0; y < height; ++y) {
          for (int x = 0; x < width; ++x) coverage(x, y) = x % period == 0 && y % period < 3 ? 255 : 0;
        }
      }
      const Reference expected(*image, coverage);
      const MipPyramid pyramid(image, [&] { return coverage; });
      ASSERT_EQ(pyramid.levels(), static_cast<int>(expected.levels.size()));
      for (int level = 0; level < pyramid.levels(); ++level) {
        const imaging::RgbImage& of_level = expected.levels[static_cast<std::size_t>(level)];
        for (int y = 0; y < of_level.height; ++y) {
          for (int x = 0; x < of_level.width; ++x)
            ASSERT_EQ(pyramid.texel(level, x, y), of_level(x, y)) << width << " " << period << " " << level;
        }
      }
    }
  }
}

TEST(MipPyramid, IsComputedOnlyWhenALevelIsAskedFor) {
  int asked = 0;
  const MipPyramid pyramid(texture(16, 16, [](int, int) { return grey(80); }), [&] {
    ++asked;
    return imaging::GrayImage();
  });
  EXPECT_EQ(pyramid.levels(), 5);
  EXPECT_EQ(asked, 0);
  EXPECT_EQ(pyramid.texel(4, 0, 0), grey(80));
  EXPECT_EQ(pyramid.texel(0, 3, 3), grey(80));
  EXPECT_EQ(asked, 1);
}

}  // namespace
}  // namespace tileflight::render::mip_pyramid_test
