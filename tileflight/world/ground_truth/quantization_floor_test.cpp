#include "tileflight/world/ground_truth/quantization_floor.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "tests/refusal.h"

namespace tileflight::ground_truth::quantization_floor_test {
namespace {

std::vector<double> random_distances(std::size_t count) {
  std::mt19937 random(11);
  std::uniform_real_distribution<double> near(0.0, 0.43), far(0.9, 7.0);
  std::vector<double> distances;
  for (std::size_t i = 0; i < count; ++i) distances.push_back(i % 50 == 7 ? far(random) : near(random));
  return distances;
}

TEST(QuantizationFloor, AgreesWithTheFormulasToTheStep) {
  for (const std::size_t count : {1U, 2U, 9U, 10U, 5001U}) {
    std::vector<double> distances = random_distances(count);
    QuantizationFloor floor(0.5);
    floor.add(distances);
    const FloorStatistics stated = floor.statistics().value();
    const auto n = static_cast<double>(count);
    double sum = 0.0, squares = 0.0, deviations = 0.0;
    for (const double d : distances) {
      sum += d;
      squares += d * d;
    }
    for (const double d : distances) deviations += (d - sum / n) * (d - sum / n);
    std::sort(distances.begin(), distances.end());
    constexpr double kStep_m = 0.5 / 1048576;
    EXPECT_EQ(stated.count, count);
    EXPECT_NEAR(stated.mean_m, sum / n, kStep_m);
    EXPECT_NEAR(stated.rmse_m, std::sqrt(squares / n), kStep_m);
    EXPECT_NEAR(stated.median_m, 0.5 * (distances[(count - 1) / 2] + distances[count / 2]), kStep_m);
    EXPECT_EQ(stated.max_m, distances.back());
    if (count > 1) {
      EXPECT_NEAR(stated.std_m.value(), std::sqrt(deviations / (n - 1.0)), kStep_m);
    } else {
      EXPECT_FALSE(stated.std_m);
    }
  }
}

TEST(QuantizationFloor, IsTheSameInPartsAndInAnyOrder) {
  std::vector<double> distances = random_distances(4000);
  QuantizationFloor whole(0.5), parts(0.5);
  whole.add(distances);
  std::shuffle(distances.begin(), distances.end(), std::mt19937(3));
  for (std::size_t i = 0; i < 4000; i += 1000) parts.add({distances.begin() + i, distances.begin() + i + 1000});
  EXPECT_EQ(whole.statistics(), parts.statistics());
  QuantizationFloor kept(0.5);
  for (std::size_t i = 0; i < 4000; i += 2000) {
    QuantizationFloor half(0.5);
    half.add({distances.begin() + i, distances.begin() + i + 2000});
    kept.add_bytes(half.to_bytes(), "half");
  }
  EXPECT_EQ(whole.statistics(), kept.statistics());
  EXPECT_FALSE(QuantizationFloor(1.0).statistics());
}

TEST(QuantizationFloor, RefusesBrokenBytes) {
  QuantizationFloor whole(0.5);
  whole.add(random_distances(400));
  const std::string bytes = whole.to_bytes();
  const auto refusal_of = [](const std::string& broken) {
    return tests::refusal_of([&] { QuantizationFloor(0.5).add_bytes(broken, "half"); });
  };
  const auto is_refused = testing::HasSubstr("half: holds no counts of distances");
  for (const std::size_t kept : {std::size_t{0}, std::size_t{7}, std::size_t{9}, std::size_t{20}})
    EXPECT_THAT(refusal_of(bytes.substr(0, kept)), is_refused) << kept;
  EXPECT_THAT(refusal_of(bytes + std::string(9, '\xFF') + "\x01\x01"), is_refused);
}

}  // namespace
}  // namespace tileflight::ground_truth::quantization_floor_test
