#include "tileflight/tiles/tileset/content_sample.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <set>

namespace tileflight::tileset::content_sample_test {
namespace {

using geometry::Vec3;
using ::testing::ElementsAre;
using ::testing::IsEmpty;

TEST(SpreadSample, IsDistinctAndEveryPrefixIsEven) {
  EXPECT_THAT(spread_sample(0, 5), IsEmpty());
  EXPECT_THAT(spread_sample(5, 0), IsEmpty());
  EXPECT_THAT(spread_sample(3, 5), ElementsAre(0, 1, 2));
  EXPECT_THAT(spread_sample(8, 4), ElementsAre(4, 0, 5, 2));
  for (const std::size_t count : {2, 7, 100, 1000}) {
    for (std::size_t wanted = 1; wanted < count; wanted = 2 * wanted + 1) {
      const std::vector<std::size_t> sample = spread_sample(count, wanted);
      const std::set<std::size_t> distinct(sample.begin(), sample.end());
      ASSERT_EQ(distinct.size(), wanted);
      EXPECT_LT(*distinct.rbegin(), count);
      // Between two neighbours lie at most four times as many as on average.
      std::size_t widest = count - *distinct.rbegin(), before = *distinct.begin();
      for (const std::size_t index : distinct) {
        widest = std::max(widest, index - before);
        before = index;
      }
      EXPECT_LE(widest, 4 * (count / wanted + 1));
    }
  }
}

/// 64 copies of a place of 462 tiles: not the same tile of each.
TEST(SpreadSample, KeepsStepWithNoPeriod) {
  for (const std::size_t period : {2, 16, 100, 462}) {
    std::set<std::size_t> phases;
    for (const std::size_t index : spread_sample(64 * period, 12)) phases.insert(index * 12 / period % 12);
    EXPECT_GE(phases.size(), std::min<std::size_t>(period, 6)) << period;
  }
}

TEST(SampleMean, IsThatOfAllAndItsErrorThatOfAllSamples) {
  const std::vector<double> all{3, 8, 1, 9, 4, 4, 7};
  EXPECT_EQ(sample_mean(all, 7).standard_error, 0.0);
  EXPECT_NEAR(sample_mean(all, 7).mean, 36.0 / 7.0, 1e-12);
  EXPECT_TRUE(std::isinf(sample_mean({3.0}, 7).standard_error));
  EXPECT_EQ(sample_mean({}, 0).mean, 0.0);
  // Brute force: the squared error of the mean of each pair, on average, is the mean of the estimates' squares.
  double squared_error = 0.0, estimated = 0.0;
  for (std::size_t i = 0; i < all.size(); ++i) {
    for (std::size_t k = 0; k < i; ++k) {
      const SampleMean mean = sample_mean({all[i], all[k]}, 7);
      squared_error += std::pow(mean.mean - 36.0 / 7.0, 2);
      estimated += std::pow(mean.standard_error, 2);
    }
  }
  EXPECT_NEAR(squared_error, estimated, 1e-9);
}

TEST(MeasureContent, CountsAndClips) {
  imaging::TexturedMesh square;
  square.mesh.vertices = {Vec3(0, 0, 0), Vec3(2, 0, 0), Vec3(2, 2, 0), Vec3(0, 2, 0)};
  square.mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  square.uv.assign(4, Eigen::Vector2f::Zero());
  square.texture = std::make_shared<const imaging::RgbImage>(16, 8);
  const ContentMeasures whole = measure_content({square, square}, {});
  EXPECT_EQ(whole.triangles, 4);
  EXPECT_EQ(whole.vertices, 8);
  EXPECT_EQ(whole.texels, 128) << "both share it";
  EXPECT_EQ(whole.attribute_bytes, 64);
  EXPECT_DOUBLE_EQ(whole.area_m2, 8.0);
  const geometry::Box3 lower_right(Vec3(1, 0, -1), Vec3(3, 1, 1));  // the centroid (4/3, 2/3) lies in it
  const ContentMeasures part = measure_content({square}, {}, lower_right);
  EXPECT_EQ(part.triangles, 1);
  EXPECT_EQ(part.vertices, 2);
  EXPECT_DOUBLE_EQ(part.area_m2, 2.0);
}

}  // namespace
}  // namespace tileflight::tileset::content_sample_test
