#include "tileflight/tiles/demo_place/photogrammetry.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>

#include "tileflight/core/base/noise.h"
#include "tileflight/tiles/simplification/simplify.h"

namespace tileflight::demo_place::photogrammetry_test {
namespace {

using geometry::Vec3;
using imaging::TexturedMesh;

/// A rough sheet of 1 m cells over (x0, 0) .. (x0 + 60, 60), too rough to lose vertices.
TexturedMesh rough_sheet(double x0) {
  TexturedMesh out;
  constexpr std::uint32_t kRow = 61;
  for (std::uint32_t j = 0; j < kRow; ++j) {
    for (std::uint32_t i = 0; i < kRow; ++i) {
      out.mesh.vertices.emplace_back(x0 + i, j, 2.0 * base::value_noise(0.7 * (x0 + i), 0.7 * j, 8));
      out.uv.emplace_back(static_cast<float>(i) / (kRow - 1), static_cast<float>(j) / (kRow - 1));
      if (i + 1 == kRow || j + 1 == kRow) continue;
      const std::uint32_t a = j * kRow + i;
      out.mesh.triangles.push_back({a, a + 1, a + 1 + kRow});
      out.mesh.triangles.push_back({a, a + 1 + kRow, a + kRow});
    }
  }
  out.texture = std::make_shared<imaging::RgbImage>(64, 64, imaging::Rgb8{100, 120, 140});
  return out;
}

TEST(Photogrammetry, ErrorHasTheDeviationAskedForAndIsSmooth) {
  const TexturedMesh sheet = rough_sheet(0);
  PhotogrammetryOptions options;
  options.simplification_m = 1e-4;
  options.noise_m = 0.05;
  const TexturedMesh out = simulate_photogrammetry({sheet}, options).front();
  PhotogrammetryOptions still = options;
  still.noise_m = 0.0;
  const TexturedMesh same = simulate_photogrammetry({sheet}, still).front();
  ASSERT_EQ(out.mesh.vertices.size(), same.mesh.vertices.size());
  double squares = 0, steps = 0;
  Vec3 last = Vec3::Zero();
  for (std::size_t i = 0; i < out.mesh.vertices.size(); ++i) {
    const Vec3 error = out.mesh.vertices[i] - same.mesh.vertices[i];
    squares += error.squaredNorm() / 3;
    if (i > 0) steps += (error - last).squaredNorm() / 3;
    last = error;
  }
  const auto count = static_cast<double>(out.mesh.vertices.size());
  EXPECT_NEAR(std::sqrt(squares / count), 0.05, 0.012);
  EXPECT_LT(std::sqrt(steps / count), 0.06);  // neighbours a metre apart: less than independent errors (0.07)
}

TEST(Photogrammetry, WhatMetStillMeets) {
  const auto out = simulate_photogrammetry({rough_sheet(0), rough_sheet(60)}, {});
  std::size_t shared = 0;
  for (const Vec3& a : out[0].mesh.vertices)
    for (const Vec3& b : out[1].mesh.vertices) shared += a == b;
  EXPECT_GT(shared, 20U);
}

TEST(Photogrammetry, StaysWithinCentimetresOfTheWorld) {
  const TexturedMesh sheet = rough_sheet(0);
  const TexturedMesh out = simulate_photogrammetry({sheet}, {}).front();
  EXPECT_LT(simplification::hausdorff_distance_m(out.mesh, sheet.mesh), 0.6);
  EXPECT_EQ(out.texture->width, 32);
  EXPECT_EQ((*out.texture)(7, 9), (imaging::Rgb8{100, 120, 140}));
}

}  // namespace
}  // namespace tileflight::demo_place::photogrammetry_test
