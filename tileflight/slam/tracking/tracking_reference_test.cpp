#include "tileflight/slam/tracking/tracking_reference.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <vector>

#include "tileflight/core/imaging/camera.h"

namespace tileflight::tracking::tracking_reference_test {
namespace {

struct Sum {
  float weighted_rho = 0.0F;
  float weight = 0.0F;

  Sum& operator+=(const Sum& other) {
    weighted_rho += other.weighted_rho;
    weight += other.weight;
    return *this;
  }
};

/// Looks up the values of a level's pixel in whole images: the definition, without any list of pixels.
class WholePictures {
 public:
  WholePictures(const keyframes::Pyramid& picture, const std::vector<ReferencePoint>& points) : picture_(picture) {
    const keyframes::PyramidLevel& level = picture.levels[0];
    finest_.resize(static_cast<std::size_t>(level.width) * level.height);
    for (const ReferencePoint& point : points) {
      const auto x = std::lround(point.pixel.x()), y = std::lround(point.pixel.y());
      if (x < 0 || y < 0 || x >= level.width || y >= level.height) continue;
      finest_[static_cast<std::size_t>(y * level.width + x)] += {point.weight * point.rho, point.weight};
    }
  }

  Sum own(std::size_t l, int x, int y) const {
    if (l == 0) return finest_[static_cast<std::size_t>(y) * picture_.levels[0].width + x];
    Sum sum;
    for (const int dy : {0, 1}) {
      for (const int dx : {0, 1}) sum += own(l - 1, 2 * x + dx, 2 * y + dy);
    }
    return sum;
  }

  Sum dilated(std::size_t l, int x, int y) const {
    constexpr std::array<std::array<int, 2>, 4> kDiagonal{{{-1, -1}, {1, -1}, {-1, 1}, {1, 1}}},
        kBeside{{{-1, 0}, {1, 0}, {0, -1}, {0, 1}}};
    Sum sum = own(l, x, y);
    const keyframes::PyramidLevel& level = picture_.levels[l];
    if (sum.weight > 0 || x < 1 || y < 1 || x >= level.width - 1 || y >= level.height - 1) return sum;
    for (const auto& [dx, dy] : l < 2 ? kDiagonal : kBeside) sum += own(l, x + dx, y + dy);
    return sum;
  }

 private:
  const keyframes::Pyramid& picture_;
  std::vector<Sum> finest_;
};

/// Points all over a picture and beyond its edges; some share a pixel, one has no weight.
std::vector<ReferencePoint> random_points(int count, float width, float height) {
  std::mt19937 random(11);
  std::uniform_real_distribution<float> unit(0.0F, 1.0F);
  std::vector<ReferencePoint> points;
  for (int i = 0; i < count; ++i) {
    const Eigen::Vector2f pixel(1.1F * width * unit(random) - 0.05F * width,
                                1.1F * height * unit(random) - 0.05F * height);
    points.push_back({pixel, 0.1F + unit(random), unit(random)});
    if (i % 5 == 0) points.push_back({pixel, 0.1F + unit(random), unit(random)});
  }
  points.push_back({{0.5F * width, 0.5F * height}, 0.4F, 0.0F});
  for (float x = 0.0F; x < width; x += 3.0F) {
    points.push_back({{x, 0.0F}, unit(random), 1.0F});
    points.push_back({{0.0F, std::min(x, height - 1.0F)}, unit(random), 1.0F});
    points.push_back({{width - 1.0F, std::min(x, height - 1.0F)}, unit(random), 1.0F});
  }
  return points;
}

void expect_the_pixels_of_whole_pictures(int width, int height, int count) {
  constexpr int kLevels = 4, kBorder = 2;
  const keyframes::LensPyramid lens =
      keyframes::build_lens_pyramid(imaging::make_pinhole(width, height, 80.0), kLevels);
  imaging::FloatImage image(width, height);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) image(x, y) = static_cast<float>(x + 2 * y);
  }
  const keyframes::Pyramid picture = keyframes::build_pyramid(image, kLevels);
  const std::vector<ReferencePoint> points =
      random_points(count, static_cast<float>(width), static_cast<float>(height));
  const TrackingReference reference = make_tracking_reference(lens, picture, points);
  const WholePictures expected(picture, points);
  ASSERT_EQ(reference.levels.size(), picture.levels.size());
  for (std::size_t l = 0; l < reference.levels.size(); ++l) {
    const ReferenceLevel& level = reference.levels[l];
    std::size_t i = 0;
    for (int y = kBorder; y < picture.levels[l].height - kBorder; ++y) {
      for (int x = kBorder; x < picture.levels[l].width - kBorder; ++x) {
        const Sum sum = expected.dilated(l, x, y);
        if (!(sum.weight > 0)) continue;
        ASSERT_LT(i, level.size()) << "level " << l;
        ASSERT_EQ(level.pixels[i], Eigen::Vector2f(x, y)) << "level " << l;
        EXPECT_EQ(level.rho[i], sum.weighted_rho / sum.weight) << "level " << l << ": " << x << ", " << y;
        EXPECT_EQ(level.intensity[i], picture.levels[l].intensity(x, y));
        ++i;
      }
    }
    EXPECT_EQ(i, level.size()) << "level " << l;
  }
}

TEST(TrackingReference, HasThePixelsOfWholePictures) {
  expect_the_pixels_of_whole_pictures(96, 64, 150);
  expect_the_pixels_of_whole_pictures(101, 75, 3);   // odd sizes, and hardly any points
  expect_the_pixels_of_whole_pictures(90, 58, 900);  // dense
}

TEST(TrackingReference, OfNoPointsIsEmpty) {
  const keyframes::LensPyramid lens = keyframes::build_lens_pyramid(imaging::make_pinhole(64, 48, 80.0), 2);
  const keyframes::Pyramid picture = keyframes::build_pyramid(imaging::FloatImage(64, 48), 2);
  for (const ReferenceLevel& level : make_tracking_reference(lens, picture, {}).levels) EXPECT_EQ(level.size(), 0U);
}

}  // namespace
}  // namespace tileflight::tracking::tracking_reference_test
