#include "tileflight/evaluation/localization/sift_features.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cmath>

#include "tileflight/evaluation/localization/feature_matching.h"
#include "tileflight/evaluation/localization/test_places.h"

namespace tileflight::localization::sift_features_test {
namespace {

using geometry::Vec2;
using imaging::GrayImage;

/// A dark spot on bright ground.
GrayImage spot(double x0, double y0, double sigma) {
  GrayImage image(160, 120);
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      const double r2 = (x - x0) * (x - x0) + (y - y0) * (y - y0);
      image(x, y) = static_cast<std::uint8_t>(std::lround(200.0 - 120.0 * std::exp(-0.5 * r2 / (sigma * sigma))));
    }
  }
  return image;
}

/// Ground with a noise texture; pixel (x, y) shows the position scale R(angle) (x, y) + offset, averaged over the
/// pixel.
struct View {
  double scale = 1.0, angle_rad = 0.0;
  Vec2 offset = Vec2::Zero();

  Vec2 place(double x, double y) const {
    const double c = scale * std::cos(angle_rad), s = scale * std::sin(angle_rad);
    return offset + Vec2(c * x - s * y, s * x + c * y);
  }
  GrayImage picture(int size) const {
    GrayImage image(size, size);
    constexpr int kParts = 3;
    for (int y = 0; y < size; ++y) {
      for (int x = 0; x < size; ++x) {
        double sum = 0.0;
        for (int k = 0; k < kParts * kParts; ++k) {
          const Vec2 p = place(x + (k % kParts + 0.5) / kParts - 0.5, y + (k / kParts + 0.5) / kParts - 0.5);
          sum += test_places::blotches_at(p.x(), p.y(), 1);
        }
        image(x, y) = static_cast<std::uint8_t>(sum / (kParts * kParts));
      }
    }
    return image;
  }
};

TEST(SiftFeatures, ASpotIsFoundWhereAndAsLargeAsItIs) {
  for (const double sigma : {3.0, 5.0, 9.0}) {
    const LocalFeatures found = find_sift_features(spot(80.3, 55.7, sigma));
    ASSERT_FALSE(found.features.empty()) << sigma;
    for (const LocalFeature& f : found.features) {
      EXPECT_NEAR(f.x, 80.3, 0.15);
      EXPECT_NEAR(f.y, 55.7, 0.15);
      EXPECT_GT(f.contrast, 0.0F);
      // In closed form the difference of blurs by s and 2^(1/3) s is extreme at s = sigma / 2^(1/6).
      EXPECT_NEAR(f.sigma, sigma / std::pow(2.0, 1.0 / 6.0), 0.12 * sigma);
    }
  }
}

TEST(SiftFeatures, AreFoundAgainInAPictureThatIsTurnedAndOfAnotherScale) {
  const View a, b{1.4, 0.7, Vec2(40.0, -90.0)};
  const LocalFeatures in_a = find_sift_features(a.picture(400)), in_b = find_sift_features(b.picture(250));
  ASSERT_GT(in_a.size(), 300U);
  const auto matches = DescriptorIndex(in_a.descriptors).match(in_b.descriptors, {.neighbors = 1});
  std::size_t clear = 0, right = 0;
  for (const FeatureMatch& match : matches) {
    if (match.ratio > 0.8F) continue;
    const LocalFeature &p = in_a.features[match.target], &q = in_b.features[match.source];
    ++clear;
    const bool is_there = (b.place(q.x, q.y) - Vec2(p.x, p.y)).norm() < 3.0;
    const bool is_as_large = std::abs(std::log(p.sigma / (1.4 * q.sigma))) < 0.4;
    const bool is_turned = std::abs(std::remainder(p.angle_rad - q.angle_rad - 0.7, 2.0 * M_PI)) < 0.3;
    right += is_there && is_as_large && is_turned ? 1 : 0;
  }
  EXPECT_GT(clear, 100U);
  EXPECT_GT(static_cast<double>(right), 0.9 * static_cast<double>(clear));
}

TEST(SiftFeatures, AreTheSameInOtherLight) {
  const GrayImage picture = View().picture(300);
  GrayImage darker = picture;
  for (std::uint8_t& value : darker.pixels) value = static_cast<std::uint8_t>(20 + value / 2);
  const LocalFeatures a = find_sift_features(picture), b = find_sift_features(darker);
  const auto matches = DescriptorIndex(a.descriptors).match(b.descriptors, {.neighbors = 1});
  std::size_t right = 0;
  for (const FeatureMatch& match : matches) {
    const LocalFeature &p = a.features[match.target], &q = b.features[match.source];
    right += std::hypot(p.x - q.x, p.y - q.y) < 1.0 ? 1 : 0;
  }
  EXPECT_GT(static_cast<double>(right), 0.8 * static_cast<double>(b.size()));
}

TEST(SiftFeatures, NoneWhereNothingIsToBeSeen) {
  EXPECT_EQ(find_sift_features(GrayImage(200, 200, 90)).size(), 0U);
  EXPECT_EQ(find_sift_features(GrayImage()).size(), 0U);
  EXPECT_EQ(find_sift_features(GrayImage(5, 300, 90)).size(), 0U);
  GrayImage seen(300, 300);
  for (int y = 0; y < 300; ++y) std::fill_n(seen.row(y), 150, std::uint8_t{255});
  const LocalFeatures left = find_sift_features(View().picture(300), seen);
  ASSERT_GT(left.size(), 50U);
  for (const LocalFeature& f : left.features) EXPECT_LT(f.x + 4.0F * f.sigma, 151.0F);
}

TEST(SiftFeatures, ThreadsAndSquaresDoNotMatter) {
  const GrayImage picture = View().picture(700);  // four tiles
  const auto run = [&](std::size_t threads) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    return find_sift_features(picture);
  };
  const LocalFeatures one = run(1), four = run(4);
  EXPECT_EQ(one.descriptors, four.descriptors);
  for (std::size_t k = 0; k < one.size(); ++k) EXPECT_EQ(one.features[k].x, four.features[k].x);
}

}  // namespace
}  // namespace tileflight::localization::sift_features_test
