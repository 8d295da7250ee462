#include "tileflight/capture/render/linear_color.h"

#include <gtest/gtest.h>

#include <cmath>

namespace tileflight::render::linear_color_test {
namespace {

TEST(LinearColor, CurveHasItsPublishedPoints) {
  EXPECT_DOUBLE_EQ(srgb_encode(0.0), 0.0);
  EXPECT_NEAR(srgb_encode(1.0), 255.0, 1e-9);
  EXPECT_NEAR(srgb_encode(0.18), 117.6, 0.2);  // middle grey
  EXPECT_NEAR(srgb_decode(188.0), 0.5029, 1e-3);
  for (int value = 0; value <= 255; ++value) EXPECT_NEAR(srgb_encode(srgb_decode(value)), value, 1e-3);
}

TEST(LinearColor, TablesFollowTheCurve) {
  const SrgbTables& tables = SrgbTables::get();
  for (int i = 0; i <= 20000; ++i) {
    const double light = i / 20000.0;
    EXPECT_NEAR(tables.encode(static_cast<float>(light)), srgb_encode(light), 0.005) << light;
  }
  for (int value = 0; value <= 255; ++value) {
    EXPECT_FLOAT_EQ(tables.decode(static_cast<std::uint8_t>(value)), static_cast<float>(srgb_decode(value)));
    EXPECT_FLOAT_EQ(tables.decode(static_cast<float>(value)), static_cast<float>(srgb_decode(value)));
    const float light = tables.decode(static_cast<std::uint8_t>(value));
    EXPECT_EQ(tables.encode(LinearRgb{light, light, light})[0], value);
  }
}

TEST(LinearColor, OutOfRangeIsClamped) {
  const SrgbTables& tables = SrgbTables::get();
  EXPECT_EQ(tables.encode(LinearRgb{-1.0F, 2.0F, 1.0F}), (imaging::Rgb8{0, 255, 255}));
  EXPECT_FLOAT_EQ(tables.decode(300.0F), 1.0F);
}

// Linear interpolation of f over a piece of width h errs by at most h^2 / 8 max |f''|; for the square root and pieces
// of x / 128 at least that is (x / 128)^2 / 8 * x^(-3/2) / 4 = 1.9e-6 sqrt(x).
TEST(LinearColor, TabulatedCurveFollowsItsFunctionAndEndsLevel) {
  const PositiveCurve root([](double x) { return std::sqrt(x); }, 3);
  for (double x = std::ldexp(1.0, -20); x < 8.0; x *= 1.0037) {
    EXPECT_NEAR(root.at(static_cast<float>(x)), std::sqrt(x), 2.2e-6 * std::sqrt(x)) << x;
  }
  EXPECT_FLOAT_EQ(root.at(8.0F), std::sqrt(8.0F));
  EXPECT_EQ(root.at(1e9F), root.at(8.0F));
  EXPECT_EQ(root.at(0.0F), root.at(std::ldexp(1.0F, -21)));
}

}  // namespace
}  // namespace tileflight::render::linear_color_test
