#include "tileflight/slam/keyframes/pattern_samples.h"

#include <gtest/gtest.h>

#include <random>

#include "tileflight/slam/keyframes/keyframe.h"
#include "tileflight/slam/keyframes/residual.h"

namespace tileflight::keyframes::pattern_samples_test {
namespace {

using geometry::SE3;
using Vec6 = geometry::Vec6;

constexpr int kWidth = 211, kHeight = 97;

PyramidLevel noise(std::uint32_t seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> grey(0.0F, 255.0F);
  imaging::FloatImage image(kWidth, kHeight);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) image(x, y) = grey(random);
  }
  return build_pyramid(image, 1).levels[0];
}

TEST(PatternSamples, HaveTheBitsOfSinglePixels) {
  const PyramidLevel level = noise(1);
  std::mt19937 random(2);
  // Up to the last place that may be sampled, on whole pixels too.
  std::uniform_real_distribution<float> x(1.0F, kWidth - 2.001F), y(1.0F, kHeight - 2.001F);
  for (int round = 0; round < 1000; ++round) {
    base::Float8 u, v, grey;
    for (int k = 0; k < base::kLanes; ++k) {
      u[k] = (round + k) % 5 == 0 ? std::floor(x(random)) : x(random);
      v[k] = (round + k) % 7 == 0 ? std::floor(y(random)) : y(random);
    }
    PatternSamples8 samples;
    sample_eight(level, u, v, samples);
    sample_eight_intensities(level, u, v, grey);
    for (int k = 0; k < base::kLanes; ++k) {
      const Texel texel = level.sample(u[k], v[k]);
      ASSERT_EQ(samples.grey[k], texel[kIntensity]);
      ASSERT_EQ(samples.gx[k], texel[kGradX]);
      ASSERT_EQ(samples.gy[k], texel[kGradY]);
      ASSERT_EQ(grey[k], level.sample_intensity(u[k], v[k]));
    }
  }
}

/// Returns the precalculation of a random motion whose linearisation point is a little off.
HostTargetPrecalc random_frame(std::mt19937& random) {
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  const auto twist = [&] {
    return Vec6(unit(random), unit(random), unit(random), unit(random), unit(random), unit(random));
  };
  const SE3 T = SE3::exp(1.0 * twist());
  const SE3 T_linear = SE3::exp(0.01 * twist()) * T;
  HostTargetPrecalc frame;
  frame.current = pair_transform(T, {0.1, 2.0}, {-0.1, 1.0});
  frame.R_linear = T_linear.rotation.toRotationMatrix().cast<float>();
  frame.t_linear = T_linear.translation.cast<float>();
  frame.gain_linear = 0.8F;
  return frame;
}

TEST(ResidualWarp, GivesTheBitsOfAResidualInOneStep) {
  const Lens lens(imaging::make_fisheye(kWidth, kHeight, 150.0));
  const PyramidLevel host = noise(3), target = noise(4);
  std::mt19937 random(5);
  int inside = 0, outside = 0;
  for (int round = 0; round < 500; ++round) {
    const auto patch = make_patch(host, lens, {20.0F + static_cast<float>(round % 170), 48.0F}, 50.0F);
    ASSERT_TRUE(patch);
    const HostTargetPrecalc frame = random_frame(random);
    Linearization one, two;
    const ResidualValue at_once = evaluate_residual(lens, target, *patch, 0.5F, frame, 9.0F, &one);
    ResidualWarp warp;
    warp_residual(lens, target, *patch, 0.5F, frame, warp);
    const ResidualValue later = evaluate_residual(warp, lens, target, *patch, 0.5F, frame, 9.0F, &two);
    ASSERT_EQ(warp.inside, at_once.state == ResidualState::kGood);
    ASSERT_EQ(later.state, at_once.state);
    ASSERT_EQ(later.energy, at_once.energy);
    ASSERT_EQ(one.sums.gg, two.sums.gg);
    ASSERT_EQ(one.sums.gr, two.sums.gr);
    ASSERT_EQ(one.d_pixel_d_pose, two.d_pixel_d_pose);
    (warp.inside ? inside : outside)++;
  }
  EXPECT_GT(inside, 50);
  EXPECT_GT(outside, 20);
}

}  // namespace
}  // namespace tileflight::keyframes::pattern_samples_test
