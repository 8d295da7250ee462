#include "tileflight/core/alignment/jackknife.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace tileflight::alignment::jackknife_test {
namespace {

using geometry::Sim3;
using geometry::Vec3;

/// For a mean of n numbers the delete-one jackknife is exactly s / sqrt(n).
TEST(Jackknife, OfAMeanItIsTheStandardError) {
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  std::vector<double> x;
  for (int k = 0; k < 12; ++k) x.push_back(normal(random));
  double sum = 0.0, squares = 0.0;
  for (const double v : x) sum += v;
  for (const double v : x) squares += std::pow(v - sum / 12.0, 2);
  const auto shifted = [](double by) { return Sim3(1.0, Eigen::Quaterniond::Identity(), Vec3(by, 0, 0)); };
  const double sigma_m =
      jackknife_sigma_m(shifted(sum / 12.0), 12, {}, [&](std::size_t k) { return shifted((sum - x[k]) / 11.0); });
  EXPECT_NEAR(sigma_m, std::sqrt(squares / 11.0 / 12.0), 1e-12);
}

TEST(Jackknife, OneGroupTellsNothing) {
  EXPECT_TRUE(std::isnan(jackknife_sigma_m(Sim3(), 1, {}, [](std::size_t) { return Sim3(); })));
}

}  // namespace
}  // namespace tileflight::alignment::jackknife_test
