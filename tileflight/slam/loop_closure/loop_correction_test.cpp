// Paths and loops whose errors are drawn from the stated covariances.

#include "tileflight/slam/loop_closure/loop_correction.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

namespace tileflight::loop_closure::loop_correction_test {
namespace {

using geometry::Mat6;
using geometry::SE3;
using geometry::Sim3;
using geometry::Vec3;
using geometry::Vec6;

/// Standard deviations of a step and of a loop's alignment: position (metres), rotation (radians), log scale.
struct Sigmas {
  double position_m = 0.0, rotation_rad = 0.0, log_scale = 0.0;

  Mat6 covariance(double factor = 1.0) const {
    Vec6 variance;
    variance << Vec3::Constant(position_m * position_m), Vec3::Constant(rotation_rad * rotation_rad);
    return factor * variance.asDiagonal();
  }
  Vec6 draw(std::mt19937& random) const {
    std::normal_distribution<double> normal;
    Vec6 out;
    for (int i = 0; i < 6; ++i) out[i] = (i < 3 ? position_m : rotation_rad) * normal(random);
    return out;
  }
};

constexpr Sigmas kStep{0.01, 0.0005, 0.001}, kLoop{0.005, 0.0002, 0.001};
constexpr int kKeyframes = 60, kRound = 50;  ///< keyframe k + kRound is where keyframe k was

std::vector<SE3> two_rounds() {
  std::vector<SE3> poses;
  for (int k = 0; k < kKeyframes; ++k) {
    const double angle = 2.0 * std::numbers::pi * k / kRound;
    poses.emplace_back(geometry::so3_exp(Vec3(0.1, 0.2, angle)),
                       Vec3(25.0 * std::cos(angle), 25.0 * std::sin(angle), 0));
  }
  return poses;
}

/// A flight's path, and the scale of its map at each keyframe (units per metre).
struct Flight {
  std::vector<SE3> truth = two_rounds();
  std::vector<LoopKeyframe> keyframes;
  std::vector<double> scale;

  /// Steps have errors of `actual`; `stated` is what the keyframes say of them.
  Flight(const Sigmas& actual, const Sigmas& stated, std::mt19937& random) {
    std::normal_distribution<double> normal;
    SE3 pose = truth.front();
    for (int k = 0; k < kKeyframes; ++k) {
      if (k > 0) {
        SE3 step = truth[k - 1].inverse() * truth[k];
        step.translation *= scale.back();
        pose = pose * step * SE3::exp(actual.draw(random));
      }
      scale.push_back(k > 0 ? scale.back() * std::exp(actual.log_scale * normal(random)) : 1.0);
      keyframes.push_back({.id = k,
                           .frame_index = k,
                           .T_map_camera = pose,
                           .features = {},
                           .image = {},
                           .step_covariance = stated.covariance(),
                           .step_log_scale_variance = stated.log_scale * stated.log_scale});
    }
  }
  /// The true motion in units of `a`.
  SE3 motion(int a, int b) const {
    const SE3 T = truth[a].inverse() * truth[b];
    return {T.rotation, scale[a] * T.translation};
  }
  MeasuredLoop loop(int a, int b, std::mt19937& random) const {
    std::normal_distribution<double> normal;
    MeasuredLoop out;
    out.loop = {a, b, Sim3(motion(a, b)), 100};
    out.alignment.a_b = {motion(a, b) * SE3::exp(kLoop.draw(random)), kLoop.covariance()};
    out.alignment.b_a = {motion(b, a) * SE3::exp(kLoop.draw(random)), kLoop.covariance()};
    out.alignment.log_scale = std::log(scale[a] / scale[b]) + kLoop.log_scale * normal(random);
    out.alignment.log_scale_variance = kLoop.log_scale * kLoop.log_scale;
    return out;
  }
  std::vector<MeasuredLoop> loops(std::mt19937& random) const {
    std::vector<MeasuredLoop> out;
    for (int k = kRound; k < kKeyframes; ++k) out.push_back(loop(k - kRound, k, random));
    return out;
  }
};

/// RMS distance of the positions from the true ones, with the first keyframe in its place.
double error_m(const std::vector<Sim3>& poses, const std::vector<SE3>& truth) {
  double sum = 0;
  for (std::size_t k = 0; k < poses.size(); ++k) sum += (poses[k].translation - truth[k].translation).squaredNorm();
  return std::sqrt(sum / static_cast<double>(poses.size()));
}

std::vector<Sim3> poses_of(const Flight& flight) {
  std::vector<Sim3> poses;
  for (const LoopKeyframe& keyframe : flight.keyframes) poses.emplace_back(keyframe.T_map_camera);
  return poses;
}

TEST(LoopCorrection, ThePathsCovarianceIsThatOfDrawnPaths) {
  std::mt19937 random(1);
  double poses = 0, scales = 0;
  constexpr int kDraws = 400, kFrom = 3, kTo = 45;
  for (int i = 0; i < kDraws; ++i) {
    const Flight flight(kStep, kStep, random);
    const geometry::Mat7 covariance = path_covariance(flight.keyframes, kFrom, kTo);
    const SE3 path = flight.keyframes[kFrom].T_map_camera.inverse() * flight.keyframes[kTo].T_map_camera;
    const Vec6 off = (flight.motion(kFrom, kTo).inverse() * path).log();
    poses += off.dot(geometry::solve_symmetric(Mat6(covariance.topLeftCorner<6, 6>()), off));
    scales += std::pow(std::log(flight.scale[kTo] / flight.scale[kFrom]), 2) / covariance(6, 6);
  }
  EXPECT_NEAR(poses / (6.0 * kDraws), 1.0, 0.12);  // four standard deviations
  EXPECT_NEAR(scales / kDraws, 1.0, 0.3);
}

TEST(LoopCorrection, DriftIsDistributedWhateverTheFlight) {
  std::mt19937 random(2);
  double before = 0, after = 0;
  for (int i = 0; i < 12; ++i) {
    const Flight flight(kStep, kStep, random);
    const auto corrected = correct_poses(flight.keyframes, flight.loops(random));
    ASSERT_TRUE(corrected) << i;
    const double was = error_m(poses_of(flight), flight.truth), is = error_m(*corrected, flight.truth);
    EXPECT_LT(is, 1.1 * was) << i;
    before += was, after += is;
    EXPECT_NEAR(corrected->at(kRound).scale * flight.scale[kRound], corrected->at(0).scale, 0.01) << i;
  }
  EXPECT_LT(after, 0.6 * before);
}

TEST(LoopCorrection, APathThatIsBetterThanItsLoopsIsKept) {
  std::mt19937 random(3);
  constexpr Sigmas kSmall{0.0002, 0.00001, 0.00001};
  for (int i = 0; i < 12; ++i) {
    const Flight flight(kSmall, kStep, random);  // stated as if it had drifted
    const std::vector<MeasuredLoop> loops = flight.loops(random);
    EXPECT_FALSE(correct_poses(flight.keyframes, loops)) << i;
    EXPECT_LT(measure_consistency(flight.keyframes, loops).contradiction, 2.0) << i;
  }
  const Flight flight(kStep, kStep, random);
  EXPECT_FALSE(correct_poses(flight.keyframes, {}));
}

TEST(LoopCorrection, SigmasThatAreTooSmallAreFoundOut) {
  std::mt19937 random(4);
  constexpr Sigmas kStated{kStep.position_m / 20, kStep.rotation_rad / 20, kStep.log_scale / 20};
  double logs = 0;
  constexpr int kFlights = 20;
  for (int i = 0; i < kFlights; ++i) {
    const Flight flight(kStep, kStated, random);
    const std::vector<MeasuredLoop> loops = flight.loops(random);
    const LoopConsistency found = measure_consistency(flight.keyframes, loops);
    logs += std::log(found.path_variance_factor) / kFlights;
    const double was = error_m(poses_of(flight), flight.truth);
    EXPECT_LT(error_m(correct_poses(flight.keyframes, loops).value(), flight.truth), 1.1 * was) << i;
  }
  // One flight's loops all see the same drift, so that a single factor is as good as one squared sigma of six.
  EXPECT_NEAR(std::exp(logs), 400.0, 200.0);
}

TEST(LoopCorrection, AFalseLoopCountsLittle) {
  std::mt19937 random(5);
  const Flight flight(kStep, kStep, random);
  std::vector<MeasuredLoop> loops = flight.loops(random);
  const double right = error_m(correct_poses(flight.keyframes, loops).value(), flight.truth);
  MeasuredLoop wrong = flight.loop(10, 40, random);
  wrong.alignment.a_b.T_a_b.translation += Vec3(2.0, -1.0, 0.5);
  wrong.alignment.b_a.T_a_b = wrong.alignment.a_b.T_a_b.inverse();
  loops.push_back(wrong);
  EXPECT_LT(error_m(correct_poses(flight.keyframes, loops).value(), flight.truth), 1.5 * right + 0.01);
}

TEST(LoopCorrection, BothSidesOfALoopAreCompared) {
  std::mt19937 random(6);
  const Flight flight(kStep, kStep, random);
  double sum = 0;
  constexpr int kDraws = 200;
  for (int i = 0; i < kDraws; ++i) sum += disagreement(flight.loop(2, 50, random).alignment) / kDraws;
  EXPECT_NEAR(sum, 1.0, 0.17);  // four standard deviations
  MeasuredLoop wrong = flight.loop(2, 50, random);
  wrong.alignment.b_a.T_a_b.translation.x() += 10.0 * kLoop.position_m;
  EXPECT_GT(disagreement(wrong.alignment), 5.0);
}

}  // namespace
}  // namespace tileflight::loop_closure::loop_correction_test
