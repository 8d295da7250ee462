#include "tileflight/evaluation/localization/feature_matching.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <random>

namespace tileflight::localization::feature_matching_test {
namespace {

std::vector<SiftDescriptor> random_descriptors(std::size_t n, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::vector<SiftDescriptor> all(n);
  for (SiftDescriptor& d : all)
    for (std::uint8_t& part : d) part = static_cast<std::uint8_t>(random() % 90);
  return all;
}

/// The same descriptors slightly changed, in reverse order.
std::vector<SiftDescriptor> seen_again(const std::vector<SiftDescriptor>& all, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::vector<SiftDescriptor> again(all.rbegin(), all.rend());
  for (SiftDescriptor& d : again)
    for (std::uint8_t& part : d)
      part = static_cast<std::uint8_t>(std::clamp<int>(part + static_cast<int>(random() % 21) - 10, 0, 255));
  return again;
}

double distance(const SiftDescriptor& a, const SiftDescriptor& b) {
  double sum = 0.0;
  for (std::size_t k = 0; k < a.size(); ++k) sum += std::pow(double(a[k]) - double(b[k]), 2);
  return std::sqrt(sum);
}

TEST(FeatureMatching, LookingAtAllIsBruteForce) {
  const auto targets = random_descriptors(300, 1), sources = random_descriptors(40, 2);
  const auto matches = DescriptorIndex(targets).match(sources, {.neighbors = 2, .shortlist = 0});
  ASSERT_EQ(matches.size(), 80U);
  for (std::size_t i = 0; i < sources.size(); ++i) {
    std::vector<double> distances;
    for (const SiftDescriptor& t : targets) distances.push_back(distance(sources[i], t));
    std::ranges::sort(distances);
    for (std::size_t k = 0; k < 2; ++k) {
      const FeatureMatch& m = matches[2 * i + k];
      EXPECT_EQ(m.source, i);
      EXPECT_NEAR(distance(sources[i], targets[m.target]), distances[k], 1e-9);
      EXPECT_NEAR(m.distance, distances[k], 1e-3);
      EXPECT_NEAR(m.ratio, distances[k] / distances[2], 1e-5);
    }
  }
}

TEST(FeatureMatching, FindsWhatIsSeenAgainAmongThousands) {
  const auto targets = random_descriptors(5000, 3);
  const auto matches = DescriptorIndex(targets).match(seen_again(targets, 4), {.neighbors = 1});
  ASSERT_FALSE(matches.empty());
  for (const FeatureMatch& m : matches) {
    EXPECT_EQ(m.target, 4999 - m.source);
    EXPECT_LT(m.ratio, 0.6F);
  }
}

TEST(FeatureMatching, FewOrNoneToCompareWith) {
  const auto few = random_descriptors(2, 5);
  EXPECT_TRUE(DescriptorIndex({}).match(few).empty());
  EXPECT_TRUE(DescriptorIndex(few).match({}).empty());
  const auto matches = DescriptorIndex(few).match(few, {.neighbors = 2});
  ASSERT_EQ(matches.size(), 4U);
  EXPECT_EQ(matches[0].distance, 0.0F);
}

TEST(FeatureMatching, ThreadsDoNotMatter) {
  const auto targets = random_descriptors(2000, 6), sources = random_descriptors(200, 7);
  const auto run = [&](std::size_t threads) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    return DescriptorIndex(targets).match(sources);
  };
  const auto one = run(1), four = run(4);
  ASSERT_EQ(one.size(), four.size());
  for (std::size_t k = 0; k < one.size(); ++k) {
    EXPECT_EQ(one[k].target, four[k].target);
    EXPECT_EQ(one[k].ratio, four[k].ratio);
  }
}

}  // namespace
}  // namespace tileflight::localization::feature_matching_test
