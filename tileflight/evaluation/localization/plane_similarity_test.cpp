#include "tileflight/evaluation/localization/plane_similarity.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cmath>
#include <random>

#include "tileflight/core/alignment/umeyama.h"

namespace tileflight::localization::plane_similarity_test {
namespace {

using geometry::Vec2;
using geometry::Vec3;

const PlaneSimilarity kTruth{2.5, 1.1, Vec2(40.0, -15.0)};

struct Random {
  std::mt19937_64 engine;
  double operator()(double low, double high) {
    return low + (high - low) * static_cast<double>(engine() >> 11U) * 0x1.0p-53;
  }
};

/// A feature transformed by T, with relative errors of that size.
PointPair carried(const PlaneSimilarity& T, Random& random, double error, std::size_t id) {
  PointPair pair;
  pair.source = {Vec2(random(-50, 50), random(-50, 50)), random(0.5, 2.0), random(-3, 3)};
  pair.target = {T * pair.source.position + T.scale * error * Vec2(random(-1, 1), random(-1, 1)),
                 T.scale * pair.source.size * (1.0 + random(-0.1, 0.1)),
                 pair.source.angle_rad + T.angle_rad + random(-0.1, 0.1)};
  pair.source_id = pair.target_id = id;
  return pair;
}

/// A wrong pair of unrelated points.
PointPair mistaken(Random& random, std::size_t id) {
  return {{Vec2(random(-50, 50), random(-50, 50)), random(0.5, 2.0), random(-3, 3)},
          {Vec2(random(-200, 200), random(-200, 200)), random(1.0, 6.0), random(-3, 3)},
          1.0,
          id,
          id};
}

std::vector<PointPair> pairs_of(std::size_t right, std::size_t wrong, std::uint64_t seed) {
  Random random{std::mt19937_64(seed)};
  std::vector<PointPair> pairs;
  for (std::size_t k = 0; k < right; ++k) pairs.push_back(carried(kTruth, random, 0.3, k));
  for (std::size_t k = 0; k < wrong; ++k) pairs.push_back(mistaken(random, right + k));
  return pairs;
}

void expect_near(const PlaneSimilarity& a, const PlaneSimilarity& b) {
  for (const Vec2& p : {Vec2(-50, -50), Vec2(50, -50), Vec2(0, 50)}) EXPECT_LT((a * p - b * p).norm(), 1.0);
}

TEST(PlaneSimilarity, OfOnePairCarriesItsPointSizeAndDirection) {
  const PointPair pair{{Vec2(3, 4), 2.0, 0.5}, {Vec2(-7, 1), 5.0, 3.0}, 1.0, 0, 0};
  const PlaneSimilarity T = similarity_from_pair(pair);
  EXPECT_DOUBLE_EQ(T.scale, 2.5);
  EXPECT_NEAR(T.angle_rad, 2.5, 1e-12);
  EXPECT_LT((T * pair.source.position - pair.target.position).norm(), 1e-12);
}

TEST(PlaneSimilarity, TheFitIsUmeyamas) {
  Random random{std::mt19937_64(3)};
  std::vector<PointPair> pairs;
  std::vector<std::size_t> all;
  std::vector<Vec3> from, to;
  for (std::size_t k = 0; k < 30; ++k) {
    pairs.push_back(carried(kTruth, random, 2.0, k));
    all.push_back(k);
    from.emplace_back(pairs[k].source.position.x(), pairs[k].source.position.y(), 0.0);
    to.emplace_back(pairs[k].target.position.x(), pairs[k].target.position.y(), 0.0);
  }
  const PlaneSimilarity fit = fit_plane_similarity(pairs, all);
  const geometry::Sim3 expected = alignment::umeyama(from, to).T_target_source;
  for (std::size_t k = 0; k < 30; ++k)
    EXPECT_LT((fit * pairs[k].source.position - (expected * from[k]).head<2>()).norm(), 1e-9);
}

TEST(PlaneSimilarity, IsFoundAmongTenTimesAsManyMistakes) {
  const std::vector<PointPair> pairs = pairs_of(60, 600, 1);
  const auto found = find_plane_similarities(pairs);
  ASSERT_FALSE(found.empty());
  expect_near(found.front().T_target_source, kTruth);
  std::size_t right = 0;
  double weight = 0.0;
  for (const std::size_t k : found.front().pairs) {
    right += k < 60 ? 1 : 0;
    weight += pairs[k].weight;
  }
  EXPECT_GE(right, 55U);
  EXPECT_LE(found.front().pairs.size() - right, 3U);
  EXPECT_DOUBLE_EQ(found.front().score, weight);
  for (std::size_t k = 1; k < found.size(); ++k) EXPECT_LE(found[k].score, found[k - 1].score);
}

TEST(PlaneSimilarity, BothOfTwoAlikePlacesAreFound) {
  std::vector<PointPair> pairs = pairs_of(40, 100, 2);
  const PlaneSimilarity second{2.5, -0.6, Vec2(-80.0, 90.0)};
  Random random{std::mt19937_64(9)};
  for (std::size_t k = 0; k < 30; ++k) pairs.push_back(carried(second, random, 0.3, 1000 + k));
  const auto found = find_plane_similarities(pairs);
  ASSERT_GE(found.size(), 2U);
  expect_near(found[0].T_target_source, kTruth);
  expect_near(found[1].T_target_source, second);
}

TEST(PlaneSimilarity, APointSpeaksOnlyOnce) {
  std::vector<PointPair> pairs = pairs_of(20, 0, 4);
  for (PointPair& pair : pairs) pair.target_id = 7;
  for (const auto& found : find_plane_similarities(pairs)) EXPECT_EQ(found.pairs.size(), 1U);
}

TEST(PlaneSimilarity, NothingComesOfNothingAndThreadsDoNotMatter) {
  EXPECT_TRUE(find_plane_similarities({}).empty());
  const std::vector<PointPair> pairs = pairs_of(60, 600, 5);
  const auto run = [&](std::size_t threads) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    return find_plane_similarities(pairs);
  };
  const auto one = run(1), four = run(4);
  ASSERT_EQ(one.size(), four.size());
  for (std::size_t k = 0; k < one.size(); ++k) {
    EXPECT_EQ(one[k].pairs, four[k].pairs);
    EXPECT_EQ(one[k].score, four[k].score);
    EXPECT_EQ(one[k].T_target_source.translation, four[k].T_target_source.translation);
  }
}

}  // namespace
}  // namespace tileflight::localization::plane_similarity_test
