#include "tileflight/evaluation/localization/path_fusion.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "tileflight/core/base/input_error.h"

namespace tileflight::localization::path_fusion_test {
namespace {

using geometry::SE3;
using geometry::Vec3;
using geometry::Vec6;
using Mat6 = Eigen::Matrix<double, 6, 6>;

/// A flight over a bend, with an odometry whose lengths are too short by `scale`, and located poses. All errors are
/// normal, with the stated sigmas.
struct Chain {
  double scale = 4.0;
  double step_sigma_m = 0.01, step_sigma_rad = 5e-4;
  double sigma_m = 0.1, sigma_rad = 3e-3;
  std::vector<SE3> truth, start;
  std::vector<std::optional<PathStep>> steps;
  std::vector<std::optional<PoseMeasurement>> measurements;
  std::mt19937_64 random;

  explicit Chain(int images, std::uint64_t seed = 1) : random(seed) {
    for (int i = 0; i < images; ++i) {
      const double t = 0.05 * i;
      truth.emplace_back(geometry::so3_exp({0.1 * std::sin(t), 0.2, 0.3 * t}),
                         Vec3(20.0 * std::sin(t), 20.0 * std::cos(t), 30.0 + t));
    }
    for (int i = 0; i < images; ++i) {
      SE3 measured = truth[i] * noise(sigma_m, sigma_rad);
      Mat6 covariance = Mat6::Zero();
      covariance.diagonal() << Vec3::Constant(sigma_m * sigma_m), Vec3::Constant(sigma_rad * sigma_rad);
      measurements.push_back(PoseMeasurement{measured, covariance});
      start.push_back(measured);
      if (i == 0) continue;
      SE3 motion = truth[i - 1].inverse() * truth[i] * noise(step_sigma_m, step_sigma_rad);
      motion.translation /= scale;
      steps.push_back(PathStep{motion, step_sigma_m / scale, step_sigma_rad});
    }
  }

  SE3 noise(double metres, double radians) {
    std::normal_distribution<double> normal;
    const auto draw = [&] { return Vec3(normal(random), normal(random), normal(random)); };
    const Vec3 turn = radians * draw();
    return {geometry::so3_exp(turn), metres * draw()};
  }

  FusedPath fuse(FusionOptions options = {}) const {
    options.scale = scale;
    return fuse_path(start, steps, measurements, options);
  }

  double error_m(const FusedPath& path, std::size_t i) const {
    return (path.poses[i].T_local_camera.translation - truth[i].translation).norm();
  }

  /// Squared error of a pose over its covariance; six on average, if the covariance is right.
  double squared_sigmas(const FusedPath& path, std::size_t i) const {
    const SE3 apart = truth[i].inverse() * path.poses[i].T_local_camera;
    Vec6 error;
    error << apart.translation, geometry::so3_log(apart.rotation);
    return error.dot(path.poses[i].covariance.inverse() * error);
  }
};

TEST(PathFusion, TheTrueChainStaysAsItIs) {
  Chain chain(40);
  for (std::size_t i = 0; i < chain.truth.size(); ++i) {
    chain.measurements[i]->T_local_camera = chain.truth[i];
    if (i == 0) continue;
    SE3 motion = chain.truth[i - 1].inverse() * chain.truth[i];
    motion.translation /= chain.scale;
    chain.steps[i - 1]->T_this_next = motion;
  }
  const FusedPath path = chain.fuse();
  for (std::size_t i = 0; i < chain.truth.size(); ++i) {
    EXPECT_LT(chain.error_m(path, i), 1e-6);
    EXPECT_NEAR(path.poses[i].scale, chain.scale, 1e-6);
  }
  EXPECT_EQ(path.noise, 1.0);
}

TEST(PathFusion, ErrorsAreAsLargeAsTheCovariancesSay) {
  double squares = 0.0;
  int poses = 0;
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    const Chain chain(30, seed);
    const FusedPath path = chain.fuse();
    for (const std::size_t i : {0, 9, 17, 29}) squares += chain.squared_sigmas(path, i), ++poses;
  }
  EXPECT_NEAR(squares / poses, 6.0, 1.2);
}

TEST(PathFusion, ItIsMoreAccurateThanTheLocatedPosesAlone) {
  double before = 0.0, after = 0.0;
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    const Chain chain(60, seed);
    const FusedPath path = chain.fuse();
    for (std::size_t i = 0; i < chain.truth.size(); ++i) {
      before += (chain.start[i].translation - chain.truth[i].translation).squaredNorm();
      after += std::pow(chain.error_m(path, i), 2);
    }
  }
  EXPECT_LT(after, 0.25 * before);
}

TEST(PathFusion, WronglyLocatedImagesDoNotCount) {
  Chain chain(60);
  for (const std::size_t i : {4, 5, 6, 30, 31, 50})
    chain.measurements[i]->T_local_camera.translation += Vec3(6.0, -3.0, 2.0);
  const FusedPath path = chain.fuse();
  for (std::size_t i = 0; i < chain.truth.size(); ++i) {
    const bool is_wrong = (i >= 4 && i <= 6) || i == 30 || i == 31 || i == 50;
    EXPECT_EQ(path.poses[i].is_outlier, is_wrong) << i;
    EXPECT_LT(chain.error_m(path, i), 0.2) << i;
  }
}

TEST(PathFusion, ImagesThatWereNotFoundAreCarriedByTheOdometry) {
  Chain chain(60);
  for (std::size_t i = 20; i < 40; ++i) chain.measurements[i].reset();
  const FusedPath path = chain.fuse();
  for (std::size_t i = 20; i < 40; ++i) EXPECT_LT(chain.error_m(path, i), 0.2) << i;
  const auto sigma_m = [&](std::size_t i) { return std::sqrt(path.poses[i].covariance.topLeftCorner<3, 3>().trace()); };
  EXPECT_GT(sigma_m(30), 1.1 * sigma_m(10));
}

TEST(PathFusion, WhereNothingIsKnownTheSigmaIsLarge) {
  Chain chain(30);
  for (std::size_t i = 10; i < 20; ++i) chain.measurements[i].reset();
  for (std::size_t i = 9; i < 20; ++i) chain.steps[i].reset();
  const FusedPath path = chain.fuse();
  EXPECT_GT(path.poses[15].covariance(0, 0), 1e4);
  EXPECT_LT(chain.error_m(path, 5), 0.2);
  EXPECT_LT(chain.error_m(path, 25), 0.2);
}

TEST(PathFusion, ADriftingScaleIsFollowed) {
  Chain chain(400);
  for (std::size_t i = 0; i < chain.steps.size(); ++i)
    chain.steps[i]->T_this_next.translation *= 1.0 + 0.1 * static_cast<double>(i) / 400.0;
  const FusedPath path = chain.fuse();
  EXPECT_NEAR(path.poses[0].scale, chain.scale, 0.03 * chain.scale);
  EXPECT_NEAR(path.poses[398].scale, chain.scale / 1.1, 0.03 * chain.scale);
}

TEST(PathFusion, LargerErrorsThanStatedShow) {
  Chain chain(80);
  for (auto& measurement : chain.measurements) measurement->covariance /= 9.0;
  const FusedPath path = chain.fuse();
  EXPECT_NEAR(path.noise, 3.0, 0.6);
}

TEST(PathFusion, MeasurementsThatShareTheirErrorsCountLess) {
  Chain alone(40), shared(40);
  for (auto& measurement : shared.measurements) measurement->shared_by = 40.0;
  const auto sigma_m = [](const FusedPath& path) { return std::sqrt(path.poses[20].covariance(0, 0)); };
  // Forty images with one error: what one of them states.
  EXPECT_NEAR(sigma_m(shared.fuse()), shared.sigma_m, 0.4 * shared.sigma_m);
  EXPECT_LT(sigma_m(alone.fuse()), 0.4 * sigma_m(shared.fuse()));
}

TEST(PathFusion, AFlightOfWhichNothingWasFoundIsRefused) {
  Chain chain(5);
  for (auto& measurement : chain.measurements) measurement.reset();
  EXPECT_THROW(chain.fuse(), InputError);
  chain.steps.pop_back();
  EXPECT_THROW(chain.fuse(), InputError);
}

}  // namespace
}  // namespace tileflight::localization::path_fusion_test
