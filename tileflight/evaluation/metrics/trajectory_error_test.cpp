#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "tests/test_data.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/evaluation/metrics/metrics.h"

namespace tileflight::metrics::trajectory_error_test {
namespace {

using geometry::SE3;
using geometry::Sim3;
using geometry::Trajectory;
using geometry::Vec3;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

/// A winding flight of about 190 m.
Trajectory winding() {
  Trajectory trajectory;
  for (int k = 0; k < 400; ++k) {
    const double t = 0.1 * k;
    trajectory.poses.push_back({t,
                                {geometry::so3_exp({0.1 * std::sin(t), 0.2 * t, 0.05 * t}),
                                 {4.0 * t, 10.0 * std::sin(0.3 * t), std::cos(t)}}});
  }
  return trajectory;
}

Sim3 some_similarity() { return {0.21, geometry::so3_exp({0.5, 1.0, -2.0}), {7.0, -3.0, 11.0}}; }

TEST(TrajectoryMetrics, SimilarTrajectoryHasNoErrorAfterSim3) {
  const auto m = evaluate_trajectory(transformed(some_similarity().inverse(), winding()), winding(),
                                     {.alignment = TrajectoryAlignment::kSim3});
  EXPECT_LT(m.ate_rmse_m, 1e-9);
  EXPECT_LT(m.ate_max_m, 1e-9);
  EXPECT_NEAR(m.scale, 0.21, 1e-12);
  EXPECT_EQ(m.poses, 400u);
  EXPECT_DOUBLE_EQ(m.path_length_m, geometry::path_length_m(winding()));
  ASSERT_EQ(m.rpe.size(), 3u);
  for (const auto& e : m.rpe) {
    EXPECT_GT(e.pairs, 0u);
    EXPECT_LT(e.translation_rmse_m, 1e-9);
    EXPECT_LT(e.rotation_rmse_deg, 1e-5);
  }
}

TEST(TrajectoryMetrics, ScaleIsAnErrorUnderSE3) {
  const Sim3 doubled(2.0, Eigen::Quaterniond::Identity(), Vec3::Zero());
  const auto m =
      evaluate_trajectory(transformed(doubled, winding()), winding(), {.alignment = TrajectoryAlignment::kSE3});
  EXPECT_DOUBLE_EQ(m.scale, 1.0);
  EXPECT_GT(m.ate_rmse_m, 10.0);
}

TEST(TrajectoryMetrics, ConstantOffsetIsTheErrorWithoutAlignment) {
  const Sim3 shift(1.0, Eigen::Quaterniond::Identity(), {3.0, 4.0, 0.0});
  const auto m =
      evaluate_trajectory(transformed(shift, winding()), winding(), {.alignment = TrajectoryAlignment::kNone});
  EXPECT_NEAR(m.ate_rmse_m, 5.0, 1e-12);
  EXPECT_NEAR(m.ate_mean_m, 5.0, 1e-12);
  EXPECT_NEAR(m.ate_max_m, 5.0, 1e-12);
  EXPECT_LT(m.rpe[0].translation_rmse_m, 1e-9) << "relative motion is the same";
}

// Straight flight of 1 m steps whose estimate is 1 % too long and turns by 0.1 degree a metre: every segment of d
// metres has the same error.
TEST(TrajectoryMetrics, RelativeErrorClosedForm) {
  const double degree = std::acos(-1.0) / 180.0;
  Trajectory truth, estimate;
  for (int k = 0; k <= 200; ++k) {
    truth.poses.push_back({0.1 * k, {Eigen::Quaterniond::Identity(), {1.0 * k, 0, 0}}});
    estimate.poses.push_back({0.1 * k, {geometry::so3_exp({0.1 * degree * k, 0, 0}), {1.01 * k, 0, 0}}});
  }
  const auto m =
      evaluate_trajectory(estimate, truth, {.alignment = TrajectoryAlignment::kNone, .rpe_deltas_m = {10, 50, 500}});
  EXPECT_EQ(m.rpe[0].pairs, 19u) << "10 steps of 1.01 m a stretch; the first one leads to the first milestone";
  EXPECT_NEAR(m.rpe[0].translation_rmse_m, 0.10, 1e-9);
  EXPECT_NEAR(m.rpe[0].rotation_rmse_deg, 1.0, 1e-6);
  EXPECT_EQ(m.rpe[1].pairs, 3u);
  EXPECT_NEAR(m.rpe[1].translation_rmse_m, 0.50, 1e-9);
  EXPECT_EQ(m.rpe[2].pairs, 0u);
  EXPECT_TRUE(std::isnan(m.rpe[2].translation_rmse_m));
}

TEST(TrajectoryMetrics, PosesArePairedByTime) {
  Trajectory every_third, truth = winding();
  for (std::size_t i = 0; i < truth.size(); i += 3) every_third.poses.push_back(truth.poses[i]);
  for (auto& pose : every_third.poses) pose.time_s += 0.004;
  const auto m = evaluate_trajectory(every_third, truth, {.alignment = TrajectoryAlignment::kSim3});
  EXPECT_EQ(m.poses, every_third.size());
  EXPECT_LT(m.ate_rmse_m, 1e-9);
}

/// The winding flight with noise on each pose, from a fixed seed.
Trajectory noisy_winding() {
  std::mt19937_64 random(4);
  std::normal_distribution<double> noise(0.0, 0.02);
  const auto vector = [&] { return Vec3(noise(random), noise(random), noise(random)); };
  Trajectory trajectory = winding();
  for (auto& pose : trajectory.poses)
    pose.T_local_camera = pose.T_local_camera * SE3(geometry::so3_exp(vector()), vector());
  return trajectory;
}

/// Mean, median, standard deviation and largest of some errors, each by its definition.
void expect_statistics(std::vector<double> errors, double rmse, const PoseErrorSpread& spread) {
  const Eigen::Map<const Eigen::ArrayXd> e(errors.data(), static_cast<Eigen::Index>(errors.size()));
  EXPECT_NEAR(rmse, std::sqrt(e.square().mean()), 1e-9);
  EXPECT_NEAR(spread.mean, e.mean(), 1e-9);
  EXPECT_NEAR(spread.std, std::sqrt((e - e.mean()).square().mean()), 1e-9);
  EXPECT_NEAR(spread.min, e.minCoeff(), 1e-9);
  EXPECT_NEAR(spread.max, e.maxCoeff(), 1e-9);
  std::sort(errors.begin(), errors.end());
  const std::size_t half = errors.size() / 2;
  EXPECT_NEAR(spread.median, errors.size() % 2 == 1 ? errors[half] : 0.5 * (errors[half - 1] + errors[half]), 1e-9);
}

// The same numbers by matrices: errors of motion as Sturm et al. 2012, (1), print them.
TEST(TrajectoryMetrics, AgreesWithBruteForceOverMatrices) {
  const Trajectory estimate = noisy_winding(), truth = winding();
  const auto m = evaluate_trajectory(
      estimate, truth, {.alignment = TrajectoryAlignment::kNone, .rpe_deltas_m = {}, .rpe_deltas_frames = {1, 7, 600}});
  std::vector<double> distances;
  for (std::size_t i = 0; i < truth.size(); ++i) {
    const geometry::Mat4 P = estimate.poses[i].T_local_camera.matrix(), Q = truth.poses[i].T_local_camera.matrix();
    distances.push_back((P - Q).topRightCorner<3, 1>().norm());
  }
  expect_statistics(distances, m.ate_rmse_m, {m.ate_mean_m, m.ate_median_m, m.ate_std_m, m.ate_min_m, m.ate_max_m});
  ASSERT_EQ(m.rpe_frames.size(), 3u);
  for (const RelativePoseError& rpe : m.rpe_frames) {
    std::vector<double> lengths, angles;
    for (std::size_t i = 0; i + rpe.delta_frames < truth.size(); i += rpe.delta_frames) {
      const auto motion = [&](const Trajectory& path) -> geometry::Mat4 {
        return path.poses[i].T_local_camera.matrix().inverse() *
               path.poses[i + rpe.delta_frames].T_local_camera.matrix();
      };
      const geometry::Mat4 E = motion(truth).inverse() * motion(estimate);
      lengths.push_back(E.topRightCorner<3, 1>().norm());
      angles.push_back(std::acos(0.5 * (E.topLeftCorner<3, 3>().trace() - 1.0)) * 180.0 / std::acos(-1.0));
    }
    EXPECT_EQ(rpe.pairs, lengths.size());
    if (lengths.empty()) continue;
    expect_statistics(lengths, rpe.translation_rmse_m, rpe.translation_m);
    expect_statistics(angles, rpe.rotation_rmse_deg, rpe.rotation_deg);
  }
  EXPECT_EQ(m.rpe_frames[0].pairs, 399u);
  EXPECT_EQ(m.rpe_frames[1].pairs, 57u);
  EXPECT_EQ(m.rpe_frames[2].pairs, 0u);
  EXPECT_TRUE(std::isnan(m.rpe_frames[2].translation_m.median));
  const StepErrors steps =
      compute_step_errors(pair_and_align(estimate, truth, {.alignment = TrajectoryAlignment::kNone}));
  expect_statistics(steps.translation_m, m.rpe_frames[0].translation_rmse_m, m.rpe_frames[0].translation_m);
}

TEST(TrajectoryMetrics, PosesWithoutTimesArePairedByIndex) {
  Trajectory without_times = noisy_winding(), truth = winding();
  for (std::size_t i = 0; i < truth.size(); ++i) without_times.poses[i].time_s = static_cast<double>(i);
  const auto by_index = evaluate_trajectory(without_times, truth, {.pairing = TrajectoryPairing::kByIndex});
  const auto by_time = evaluate_trajectory(noisy_winding(), truth);
  EXPECT_EQ(by_index.ate_rmse_m, by_time.ate_rmse_m);
  EXPECT_EQ(by_index.poses, 400u);
  without_times.poses.pop_back();
  EXPECT_THAT([&] { evaluate_trajectory(without_times, truth, {.pairing = TrajectoryPairing::kByIndex}); },
              ThrowsMessage<InputError>(HasSubstr("has 399 poses and the truth 400")));
}

TEST(TrajectoryMetrics, SaysHowMuchWasCompared) {
  Trajectory first_half = noisy_winding();
  first_half.poses.resize(200);
  first_half.poses.push_back({1000.0, {}});
  const auto m = evaluate_trajectory(first_half, winding());
  EXPECT_EQ(m.poses, 200u);
  EXPECT_EQ(m.estimated_poses, 201u);
  EXPECT_EQ(m.true_poses, 400u);
  EXPECT_NEAR(m.time_covered, 19.9 / 39.9, 1e-12);
  for (auto& pose : first_half.poses) pose.time_s += 0.04;
  EXPECT_EQ(evaluate_trajectory(first_half, winding(), {.max_time_difference_s = 0.05}).poses, 200u);
  EXPECT_THAT([&] { evaluate_trajectory(first_half, winding(), {.max_time_difference_s = 0.03}); },
              ThrowsMessage<InputError>(HasSubstr("share a time with the truth (30 ms)")));
}

TEST(TrajectoryMetrics, AGapInTheMiddleIsNotCovered) {
  Trajectory with_gap = noisy_winding();
  with_gap.poses.erase(with_gap.poses.begin() + 100, with_gap.poses.begin() + 260);
  const auto m = evaluate_trajectory(with_gap, winding());
  EXPECT_NEAR(m.time_covered, (39.9 - 16.1) / 39.9, 1e-12);
  const std::vector<TimeGap> gaps = find_time_gaps(with_gap, 39.9);
  ASSERT_EQ(gaps.size(), 1u);
  EXPECT_NEAR(gaps[0].to_s - gaps[0].from_s, 16.1, 1e-9);
  EXPECT_TRUE(find_time_gaps(winding(), 39.9).empty());
  EXPECT_TRUE(find_time_gaps(with_gap, 39.9, gaps).empty()) << "nothing was recorded there";
  Trajectory keyframes;  // irregular, but nowhere a gap
  for (const double time_s : {0.0, 0.3, 0.5, 1.4, 1.7, 2.0, 3.1, 3.3}) keyframes.poses.push_back({time_s, {}});
  EXPECT_TRUE(find_time_gaps(keyframes, 3.3).empty());
}

TEST(TrajectoryMetrics, RefusesBadInput) {
  Trajectory later = winding();
  for (auto& pose : later.poses) pose.time_s += 1000.0;
  EXPECT_THAT([&] { evaluate_trajectory(later, winding(), {.alignment = TrajectoryAlignment::kSim3}); },
              ThrowsMessage<InputError>(HasSubstr("only 0 of its poses share a time with the truth")))
      << "no time in common";
  EXPECT_THAT([&] { evaluate_trajectory({}, winding(), {.alignment = TrajectoryAlignment::kSim3}); },
              ThrowsMessage<InputError>(HasSubstr("only 0 of its poses share a time with the truth")));
  EXPECT_THAT([&] { evaluate_trajectory(winding(), {}, {.alignment = TrajectoryAlignment::kSim3}); },
              ThrowsMessage<InputError>(HasSubstr("only 0 of its poses share a time with the truth")));
  EXPECT_THAT(
      [&] {
        evaluate_trajectory(winding(), winding(), {.alignment = TrajectoryAlignment::kSim3, .rpe_deltas_m = {0.0}});
      },
      ThrowsMessage<InputError>(HasSubstr("RPE: the path length must be above zero")));
  EXPECT_THAT([&] { evaluate_trajectory(winding(), winding(), {.rpe_deltas_frames = {0}}); },
              ThrowsMessage<InputError>(HasSubstr("RPE: the number of frames must be above zero")));
  Trajectory broken = winding();
  broken.poses[5].T_local_camera.translation.x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT([&] { evaluate_trajectory(broken, winding(), {.alignment = TrajectoryAlignment::kSim3}); },
              ThrowsMessage<InputError>(HasSubstr("estimated trajectory: a position is not finite")));
  EXPECT_THAT([&] { evaluate_trajectory(broken, winding(), {.alignment = TrajectoryAlignment::kNone}); },
              ThrowsMessage<InputError>(HasSubstr("estimated trajectory: a position is not finite")));
  Trajectory still = winding();
  for (auto& pose : still.poses) pose.T_local_camera.translation.setZero();
  EXPECT_THAT([&] { evaluate_trajectory(still, winding(), {.alignment = TrajectoryAlignment::kSim3}); },
              ThrowsMessage<InputError>(HasSubstr("trajectory: does not move")));
}

// ------------------------------------------------------------------------------------------------ real trajectories

struct Expected {
  const char *estimate, *truth;
  TrajectoryAlignment alignment;
  std::size_t poses;
  double ate_rmse, ate_mean, ate_max, scale, path_length;
  std::size_t pairs_1m;
  double translation_1m, rotation_1m;
};

/// Its name in lists of tests: without it, GoogleTest would print its bytes, in which addresses change.
void PrintTo(const Expected& e, std::ostream* out) { *out << e.estimate; }

class RealTrajectories : public ::testing::TestWithParam<Expected> {};

// Values computed once from the published formulas by other means: alignment by Horn's unit quaternions (1987) instead
// of Umeyama's singular values, relative motions by rotation matrices.
TEST_P(RealTrajectories, AgreeWithTheFormulas) {
  TILEFLIGHT_REQUIRE_TEST_DATA(folder, "trajectories/evo");
  const Expected& e = GetParam();
  const auto m = evaluate_trajectory(geometry::read_tum(folder / e.estimate), geometry::read_tum(folder / e.truth),
                                     {.alignment = e.alignment});
  EXPECT_EQ(m.poses, e.poses);
  EXPECT_NEAR(m.ate_rmse_m, e.ate_rmse, 1e-8);
  EXPECT_NEAR(m.ate_mean_m, e.ate_mean, 1e-8);
  EXPECT_NEAR(m.ate_max_m, e.ate_max, 1e-8);
  EXPECT_NEAR(m.scale, e.scale, 1e-8);
  EXPECT_NEAR(m.path_length_m, e.path_length, 1e-8);
  EXPECT_EQ(m.rpe[0].pairs, e.pairs_1m);
  EXPECT_NEAR(m.rpe[0].translation_rmse_m, e.translation_1m, 1e-8);
  EXPECT_NEAR(m.rpe[0].rotation_rmse_deg, e.rotation_1m, 1e-6);
  EXPECT_EQ(m.rpe[2].pairs, 0u) << "no 50 m were walked";
}

INSTANTIATE_TEST_SUITE_P(
    TrajectoryMetrics, RealTrajectories,
    ::testing::Values(
        Expected{"freiburg1_xyz-ORB_kf_mono.txt", "freiburg1_xyz-groundtruth.txt", TrajectoryAlignment::kSim3, 32,
                 0.009754582, 0.008218699, 0.027924002, 1.105622364, 4.555822556, 2, 0.027114951, 1.344749736},
        Expected{"freiburg1_xyz-rgbdslam.txt", "freiburg1_xyz-groundtruth.txt", TrajectoryAlignment::kNone, 785,
                 0.020079418, 0.018062518, 0.043289434, 1.0, 8.015045624, 7, 0.022611896, 1.108530734},
        Expected{"freiburg1_xyz-rgbdslam_drift.txt", "freiburg1_xyz-groundtruth.txt", TrajectoryAlignment::kSE3, 785,
                 0.013470119, 0.012024516, 0.034759897, 1.0, 8.015045624, 7, 0.022612068, 1.108519491},
        Expected{"fr2_desk_ORB.txt", "fr2_desk_groundtruth.txt", TrajectoryAlignment::kSE3, 2174, 0.008118978,
                 0.007491777, 0.024299594, 1.0, 18.690983348, 18, 0.011653475, 0.697271544},
        Expected{"fr2_desk_ORB_kf_mono.txt", "fr2_desk_groundtruth.txt", TrajectoryAlignment::kSim3, 118, 0.007729265,
                 0.007103616, 0.015688558, 2.228021754, 15.573200458, 11, 0.020381581, 0.616360104}));

}  // namespace
}  // namespace tileflight::metrics::trajectory_error_test
