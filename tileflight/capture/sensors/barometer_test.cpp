#include "tileflight/capture/sensors/barometer.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <utility>

#include "tileflight/core/base/input_error.h"

namespace tileflight::sensors::barometer_test {
namespace {

using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

// U.S. Standard Atmosphere 1976, table I: pressure at geometric heights.
TEST(Atmosphere, IsTheStandardsTable) {
  const Atmosphere standard;
  for (const auto& [height_m, pressure_pa] : {std::pair{0.0, 101325.0},
                                              {1000.0, 89876.0},
                                              {2000.0, 79501.0},
                                              {3000.0, 70121.0},
                                              {5000.0, 54048.0},
                                              {10000.0, 26500.0}}) {
    EXPECT_NEAR(standard.pressure_pa(height_m), pressure_pa, 1e-4 * pressure_pa) << height_m;
    EXPECT_NEAR(standard.height_m(standard.pressure_pa(height_m)), height_m, 1e-8);
  }
  EXPECT_NEAR(standard.temperature_k(5000.0), 255.676, 1e-3);
}

// The barometric law of a thin layer: dp / dh = -rho g, rho = p M / (R T).
TEST(Atmosphere, PressureFallsByTheWeightOfTheAirOnAWarmDayToo) {
  const Atmosphere warm{100000.0, 303.15};
  const double height_m = 1500.0;
  const double slope = (warm.pressure_pa(height_m + 1) - warm.pressure_pa(height_m - 1)) / 2;
  const double gravity = 9.80665 * std::pow(6356766.0 / (6356766.0 + height_m), 2);
  const double density = warm.pressure_pa(height_m) * 0.0289644 / (8.31432 * warm.temperature_k(height_m));
  EXPECT_NEAR(slope, -density * gravity, 1e-5 * density * gravity);
}

TEST(Barometer, WithoutErrorsItsAltitudeIsTheHeight) {
  const auto samples = simulate_barometer([](double t) { return 2800.0 + 3 * t; }, 5.0, 15.0,
                                          {.rate_hz = 20.0, .noise_pa = 0.0, .drift_pa = 0.0});
  ASSERT_EQ(samples.size(), 201U);
  for (const BarometerSample& sample : samples) EXPECT_NEAR(sample.altitude_m, 2800.0 + 3 * sample.time_s, 1e-8);
}

TEST(Barometer, NoiseAndDriftHaveTheirStatistics) {
  const auto samples = simulate_barometer([](double) { return 0.0; }, 0.0, 40000.0,
                                          {.rate_hz = 10.0, .noise_pa = 2.0, .drift_pa = 10.0, .drift_time_s = 20.0});
  double squares = 0.0, steps = 0.0, lagged = 0.0;
  const std::size_t n = samples.size() - 200;
  for (std::size_t i = 0; i < n; ++i) {
    const auto error = [&](std::size_t k) { return samples[k].pressure_pa - 101325.0; };
    squares += error(i) * error(i);
    steps += std::pow(error(i + 1) - error(i), 2);
    lagged += error(i) * error(i + 200);
  }
  const auto count = static_cast<double>(n);
  EXPECT_NEAR(std::sqrt(squares / count), std::hypot(2.0, 10.0), 0.5);
  EXPECT_NEAR(steps / count, 2 * 4.0 + 2 * 100.0 * (1 - std::exp(-1.0 / 200)), 0.1);
  EXPECT_NEAR(lagged / count, 100.0 * std::exp(-1.0), 8.0);
}

TEST(Barometer, RefusesWhatCannotBe) {
  const auto ground = [](double) { return 0.0; };
  EXPECT_THAT([&] { simulate_barometer(ground, 0, 1, {.rate_hz = -1.0}); },
              ThrowsMessage<InputError>(HasSubstr("barometer rate: must lie between 0 and 100000 Hz")));
  EXPECT_THAT([&] { simulate_barometer(ground, 0, 1, {.drift_time_s = 0.0}); },
              ThrowsMessage<InputError>(HasSubstr("barometer drift_time: must be more than 0")));
  EXPECT_THAT([&] { simulate_barometer([](double) { return 12000.0; }, 0, 1); },
              ThrowsMessage<InputError>(HasSubstr("between 5 km below and 11 km above sea level")));
}

}  // namespace
}  // namespace tileflight::sensors::barometer_test
