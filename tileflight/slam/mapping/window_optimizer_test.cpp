#include "tileflight/slam/mapping/window_optimizer.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "tileflight/slam/mapping/normal_equations.h"
#include "tileflight/slam/mapping/test_random_window.h"
#include "tileflight/slam/mapping/test_rendered_window.h"

namespace tileflight::mapping::window_optimizer_test {
namespace {

using geometry::SE3;
using keyframes::ResidualState;
using test_support::RenderedFlight;

constexpr int kKeyframes = 4;

const RenderedFlight& flight() {
  static const RenderedFlight kFlight;
  return kFlight;
}

/// Window of true poses and inverse distances, all points observed everywhere.
keyframes::Window true_window() {
  static const keyframes::Window kWindow = [] {
    keyframes::Window window = test_support::make_true_window(flight(), kKeyframes);
    for (int h = 0; h < kKeyframes; ++h) {
      for (const keyframes::Patch& patch : flight().patches(2 * h, *window.keyframes[h].pyramid, 200)) {
        keyframes::ActivePoint point;
        point.patch = patch;
        point.rho = flight().rho(2 * h, patch.ray);
        point.observations = test_support::observe_everywhere(h, kKeyframes);
        window.keyframes[h].points.push_back(point);
      }
    }
    return window;
  }();
  return kWindow;
}

/// The true window with errors of about a pixel in poses and points.
keyframes::Window disturbed_window() {
  keyframes::Window window = true_window();
  std::mt19937 random(2);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  for (keyframes::Keyframe& keyframe : window.keyframes) {
    geometry::Vec6 twist;
    for (int i = 0; i < 6; ++i) twist[i] = (i < 3 ? 0.06 : 0.003) * unit(random);
    keyframe.T_camera_map_linear = SE3::exp(twist) * keyframe.T_camera_map_linear;
    keyframe.brightness_linear.a = 0.05 * unit(random);
    for (keyframes::ActivePoint& point : keyframe.points) point.rho *= static_cast<float>(1.0 + 0.04 * unit(random));
  }
  return window;
}

/// Pose of keyframe i relative to the first one, lengths in units of the way to the last.
SE3 scaled_pose(const keyframes::Window& window, int i) {
  const auto relative = [&](int k) {
    return window.keyframes[k].T_camera_map() * window.keyframes[0].T_camera_map().inverse();
  };
  SE3 pose = relative(i);
  pose.translation /= relative(kKeyframes - 1).translation.norm();
  return pose;
}

struct WindowErrors {
  double translation = 0.0;   ///< largest, as a share of the window's baseline
  double rotation_rad = 0.0;  ///< largest
  double rho = 0.0;           ///< median relative error, after the best scale
};

WindowErrors errors_of(const keyframes::Window& window) {
  const keyframes::Window truth = true_window();
  WindowErrors errors;
  for (int i = 1; i < kKeyframes; ++i) {
    const SE3 mine = scaled_pose(window, i), exact = scaled_pose(truth, i);
    errors.translation = std::max(errors.translation, (mine.translation - exact.translation).norm());
    errors.rotation_rad =
        std::max(errors.rotation_rad, geometry::so3_log(mine.rotation.conjugate() * exact.rotation).norm());
  }
  std::vector<double> log_ratios;
  for (const keyframes::Keyframe& keyframe : window.keyframes) {
    for (const keyframes::ActivePoint& point : keyframe.points)
      log_ratios.push_back(std::log(point.rho / flight().rho(2 * keyframe.id, point.patch.ray)));
  }
  const auto median = [](std::vector<double>& values) {
    std::nth_element(values.begin(), values.begin() + values.size() / 2, values.end());
    return values[values.size() / 2];
  };
  const double scale = median(log_ratios);
  for (double& value : log_ratios) value = std::abs(value - scale);
  errors.rho = median(log_ratios);
  return errors;
}

/// The true window, in which each keyframe also has the picture of a camera half a metre to the right.
keyframes::Window true_stereo_window() {
  static const keyframes::Window kWindow = [] {
    keyframes::Window window;
    const SE3 T_right_left(Eigen::Quaterniond::Identity(), geometry::Vec3(-0.5, 0, 0));
    window.stereo_cameras.push_back({flight().lens.lenses[0], T_right_left});
    for (const keyframes::Keyframe& mono : true_window().keyframes) {
      keyframes::Keyframe keyframe = mono;
      const imaging::RgbImage image = keyframes::test_support::ReliefCamera(flight().camera, flight().relief)
                                          .render((T_right_left * mono.T_camera_map()).inverse());
      keyframe.stereo.resize(1);
      keyframe.stereo[0].brightness_information = {1e3, 1.0};
      keyframe.stereo[0].pyramid =
          std::make_shared<const keyframes::Pyramid>(keyframes::build_pyramid(keyframes::luminance(image, nullptr), 1));
      for (keyframes::ActivePoint& point : keyframe.points) point.stereo_observations.resize(1);
      add_keyframe(window, std::move(keyframe));
    }
    return window;
  }();
  return kWindow;
}

TEST(OptimizeWindow, FindsTheScaleByStereoPictures) {
  const keyframes::Lens& lens = flight().lens.lenses[0];
  keyframes::Window window = true_stereo_window();
  constexpr double kScale = 1.03;  // a map too large
  for (keyframes::Keyframe& keyframe : window.keyframes) {
    keyframe.T_camera_map_linear.translation *= kScale;
    for (keyframes::ActivePoint& point : keyframe.points) point.rho /= static_cast<float>(kScale);
  }
  const auto baseline_m = [](const keyframes::Window& w) {
    const SE3 T = w.keyframes[kKeyframes - 1].T_camera_map() * w.keyframes[0].T_camera_map().inverse();
    return T.translation.norm();
  };
  const double truth_m = baseline_m(true_stereo_window());
  EXPECT_NEAR(baseline_m(window) / truth_m, kScale, 1e-3);
  keyframes::Window again = window;
  optimize_window(window, lens, flight().options.window, 30);
  EXPECT_NEAR(baseline_m(window) / truth_m, 1.0, 0.008) << "0.02 pixels of disparity";
  const tbb::global_control one_thread(tbb::global_control::max_allowed_parallelism, 1);
  optimize_window(again, lens, flight().options.window, 30);
  EXPECT_EQ(baseline_m(again), baseline_m(window)) << "the same for any number of threads";
}

TEST(OptimizeWindow, FindsTheTruePosesAndInverseDistances) {
  const keyframes::Lens& lens = flight().lens.lenses[0];
  const keyframes::WindowOptions& options = flight().options.window;
  keyframes::Window window = disturbed_window(), truth = true_window();
  const WindowErrors before = errors_of(window);
  const WindowResult result = optimize_window(window, lens, options, 20);
  const WindowErrors after = errors_of(window);
  EXPECT_GT(before.translation, 0.015);
  EXPECT_LT(after.translation, 0.008);
  EXPECT_GT(before.rotation_rad, 0.003);
  EXPECT_LT(after.rotation_rad, 0.0015);
  EXPECT_GT(before.rho, 0.015);
  EXPECT_LT(after.rho, 0.008);
  EXPECT_LT(result.rmse, 1.02 * optimize_window(truth, lens, options, 0).rmse) << "as well as the truth fits";
  EXPECT_GT(result.iterations, 1);
  EXPECT_LT(result.iterations, 20) << "converged";
  // Brightness is determined up to a common gain.
  for (const keyframes::Keyframe& keyframe : window.keyframes)
    EXPECT_NEAR(keyframe.brightness().a, window.keyframes[0].brightness().a, 0.005);
}

/// Estimates the focal length alone, at the true poses, from a start that is wrong by this share of it.
double estimate_focal_length(double start) {
  keyframes::Window window;
  add_intrinsics_unknowns(window, {.focal_length = 1.0, .aspect = 1e12, .principal_point = 1e12});
  for (keyframes::Keyframe& keyframe : true_window().keyframes) add_keyframe(window, std::move(keyframe));
  window.H_prior.diagonal().head(8 * kKeyframes).array() += 1e12;
  window.intrinsics.linear = keyframes::IntrinsicsDelta(start, start, 0, 0);
  const keyframes::Lens& lens = flight().lens.lenses[0];
  for (keyframes::Keyframe& keyframe : window.keyframes) {
    for (keyframes::ActivePoint& point : keyframe.points) {
      keyframes::update_ray(lens.apply_delta(window.intrinsics.linear), point.patch);
      point.patch.ray_linear = point.patch.ray;
    }
  }
  optimize_window(window, lens, flight().options.window, 20);
  const keyframes::Patch& patch = window.keyframes[1].points[7].patch;
  const keyframes::Lens found = lens.apply_delta(window.intrinsics.value());
  EXPECT_LT((patch.ray - found.unproject(patch.pixel.cast<double>())->cast<float>()).norm(), 1e-6F);
  return window.intrinsics.value()[0];
}

TEST(OptimizeWindow, FindsTheFocalLengthWhereThePosesAreKnown) {
  const double from_truth = estimate_focal_length(0.0);
  EXPECT_LT(std::abs(from_truth), 0.002);
  for (const double wrong : {-0.01, 0.01}) EXPECT_NEAR(estimate_focal_length(wrong), from_truth, 0.002);
}

/// Mean over the good observations, from the residuals one by one.
TEST(OptimizeWindow, StatesTheErrorOfTheGoodResiduals) {
  keyframes::Window window = disturbed_window();
  const keyframes::Lens& lens = flight().lens.lenses[0];
  const WindowResult result = optimize_window(window, lens, flight().options.window, 2);
  double energy = 0.0;
  int good = 0, outliers = 0;
  const std::vector<HostTargetPair> pairs = make_host_target_pairs(window);
  for (int h = 0; h < kKeyframes; ++h) {
    for (const keyframes::ActivePoint& point : window.keyframes[h].points) {
      for (const keyframes::Observation& o : point.observations) {
        const keyframes::Keyframe& target = window.keyframes[o.target];
        const keyframes::ResidualValue value = keyframes::evaluate_residual(
            lens, target.pyramid->levels[0], point.patch, point.rho, pairs[h * kKeyframes + o.target].frame,
            flight().options.window.huber, nullptr);
        const float threshold = std::max(window.keyframes[h].energy_threshold, target.energy_threshold);
        const bool is_good = value.state == ResidualState::kGood && value.energy <= threshold;
        EXPECT_EQ(o.state == ResidualState::kGood, is_good);
        outliers += o.state == ResidualState::kOutlier;
        if (is_good) energy += value.energy, ++good;
      }
    }
  }
  EXPECT_EQ(result.good_residuals, good);
  EXPECT_NEAR(result.rmse, std::sqrt(energy / (8 * good)), 1e-4 * result.rmse);
  EXPECT_GT(good, 1000);
  EXPECT_GT(outliers, 0);
}

TEST(OptimizeWindow, IsTheSameForAnyNumberOfThreads) {
  std::vector<Eigen::Matrix4d> reference;
  for (const std::size_t threads : {1U, 2U, 4U}) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    keyframes::Window window = disturbed_window();
    optimize_window(window, flight().lens.lenses[0], flight().options.window, 3);
    std::vector<Eigen::Matrix4d> poses;
    for (const keyframes::Keyframe& keyframe : window.keyframes) poses.push_back(keyframe.T_camera_map().matrix());
    if (reference.empty()) reference = poses;
    EXPECT_TRUE(poses == reference) << threads;
  }
}

/// delta^T H delta + 2 b^T delta.
double prior_energy(const keyframes::Window& window, const Eigen::VectorXd& delta) {
  return delta.dot(window.H_prior * delta) + 2.0 * window.b_prior.dot(delta);
}

TEST(Relinearize, KeepsTheStateAndThePriorsEnergyUpToAConstant) {
  keyframes::Window window = test_support::random_window(3, 2, 7, true);
  std::mt19937 random(1);
  std::normal_distribution<double> normal;
  const int n = window.unknowns();
  const Eigen::MatrixXd A = Eigen::MatrixXd::NullaryExpr(n, n, [&] { return normal(random); });
  window.H_prior = A * A.transpose();
  window.b_prior = Eigen::VectorXd::NullaryExpr(n, [&] { return normal(random); });
  for (int i = 0; i < 8; ++i) window.keyframes[1].delta[i] = 0.1 * normal(random);
  for (int i = 0; i < 4; ++i) window.intrinsics.delta[i] = 0.1 * normal(random);
  const keyframes::Window before = window;
  relinearize(window, 1);
  relinearize_intrinsics(window);

  EXPECT_TRUE(window.keyframes[1].delta.isZero(0));
  EXPECT_TRUE(window.intrinsics.delta.isZero(0));
  EXPECT_LT((window.keyframes[1].T_camera_map().matrix() - before.keyframes[1].T_camera_map().matrix()).norm(), 1e-12);
  EXPECT_NEAR(window.keyframes[1].brightness().a, before.keyframes[1].brightness().a, 1e-15);
  EXPECT_NEAR(window.keyframes[1].brightness().b, before.keyframes[1].brightness().b, 1e-15);
  EXPECT_LT((window.intrinsics.value() - before.intrinsics.value()).norm(), 1e-15);
  const Eigen::VectorXd moved = stacked_delta(before);
  for (int trial = 0; trial < 5; ++trial) {
    const Eigen::VectorXd x = Eigen::VectorXd::NullaryExpr(n, [&] { return normal(random); });
    EXPECT_NEAR(prior_energy(window, x), prior_energy(before, moved + x) - prior_energy(before, moved), 1e-8);
  }
}

}  // namespace
}  // namespace tileflight::mapping::window_optimizer_test
