#include "tileflight/core/alignment/consistent_pairs.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <random>

namespace tileflight::alignment::consistent_pairs_test {
namespace {

using geometry::Sim3;
using geometry::Vec3;

class Planted : public ::testing::Test {
 protected:
  Vec3 somewhere(double size_m) { return size_m * Vec3(unit_(random_), unit_(random_), unit_(random_)); }

  /// `right` pairs related by a rigid motion, then `wrong` random ones.
  PutativeMatches pairs(std::size_t right, std::size_t wrong) {
    const Sim3 T(1.03, geometry::so3_exp({0.0, 0.0, 2.0}), {30.0, -20.0, 5.0});
    PutativeMatches result;
    for (std::size_t k = 0; k < right + wrong; ++k) {
      result.source.push_back(somewhere(60.0));
      result.target.push_back(k < right ? Vec3(T * result.source.back() + somewhere(0.3)) : somewhere(80.0));
      result.descriptor_distance.push_back(0.0f);
    }
    return result;
  }

  std::mt19937_64 random_{11};
  std::uniform_real_distribution<double> unit_{-1.0, 1.0};
};

TEST_F(Planted, GroupIsFoundAmongManyWrongPairs) {
  const PutativeMatches all = pairs(14, 300);
  ConsistencyOptions options;
  options.tolerance_m = 1.0;
  options.tolerance_share = 0.05;
  const auto groups = find_consistent_groups(all, options);
  ASSERT_FALSE(groups.empty());
  std::size_t right = 0;
  for (const std::size_t k : groups.front()) right += k < 14 ? 1 : 0;
  EXPECT_GE(right, 10u) << "places closer together than the tolerance are not held against each other";
  EXPECT_LE(groups.front().size() - right, 2u);
}

TEST_F(Planted, GravityTellsTurnedOverGroups) {
  PutativeMatches upside_down = pairs(0, 0);
  const Sim3 over(1.0, geometry::so3_exp({3.1, 0.0, 0.0}), {1.0, 2.0, 3.0});
  for (int k = 0; k < 20; ++k) {
    upside_down.source.push_back(somewhere(60.0));
    upside_down.target.push_back(over * upside_down.source.back());
    upside_down.descriptor_distance.push_back(0.0f);
  }
  ConsistencyOptions options;
  options.tolerance_m = 1.0;
  EXPECT_GE(find_consistent_groups(upside_down, options).front().size(), 15u);
  options.source_up = options.target_up = Vec3::UnitZ();
  EXPECT_LE(find_consistent_groups(upside_down, options).front().size(), 8u);
}

TEST_F(Planted, AsLargeAsTheLargestCliqueOfSmallGraphs) {
  for (int round = 0; round < 20; ++round) {
    const PutativeMatches all = pairs(5, 9);
    ConsistencyOptions options;
    options.tolerance_m = 3.0;
    const auto agree = [&](std::size_t a, std::size_t b) {
      const double s = (all.source[a] - all.source[b]).norm(), t = (all.target[a] - all.target[b]).norm();
      return std::min(s, t) >= 6.0 && std::abs(s - t) <= 3.0 + options.tolerance_share * std::max(s, t);
    };
    int largest = 0;
    for (unsigned set = 1; set < (1u << 14); ++set) {
      bool clique = true;
      for (std::size_t a = 0; a < 14 && clique; ++a) {
        for (std::size_t b = a + 1; b < 14 && clique; ++b)
          clique = !((set >> a) & 1u) || !((set >> b) & 1u) || agree(a, b);
      }
      if (clique) largest = std::max(largest, std::popcount(set));
    }
    const auto groups = find_consistent_groups(all, options);
    EXPECT_GE(static_cast<int>(groups.front().size()), largest - 1) << "greedy, but from every start";
    for (const std::size_t a : groups.front()) {
      for (const std::size_t b : groups.front()) EXPECT_TRUE(a == b || agree(a, b));
    }
  }
}

TEST(SimilarPlaces, NearestDescriptorsBothWays) {
  Eigen::MatrixXf source(3, 2), target(3, 2);
  source << 1, 0, 0, 1, 0, 0;
  target << 0.9f, 0.1f, 0.5f, 0.6f, 0, 0;
  const std::vector<Vec3> s = {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}}, t = {{0, 1, 0}, {1, 1, 0}, {2, 1, 0}};
  const PutativeMatches pairs = match_descriptors(s, source, t, target);
  ASSERT_EQ(pairs.source.size(), 2u) << "rows of zeros pair with nothing";
  EXPECT_EQ(pairs.source[0], s[0]);
  EXPECT_EQ(pairs.target[0], t[0]);
  EXPECT_NEAR(pairs.descriptor_distance[0], 0.1414f, 1e-3f);
  EXPECT_EQ(pairs.source[1], s[1]);
  EXPECT_EQ(pairs.target[1], t[1]);
  EXPECT_EQ(match_descriptors(s, source, t, target, 1).source.size(), 1u);
}

}  // namespace
}  // namespace tileflight::alignment::consistent_pairs_test
