#include "tileflight/slam/mapping/normal_equations.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <Eigen/Dense>

#include "tileflight/slam/mapping/gauge.h"
#include "tileflight/slam/mapping/test_random_window.h"

namespace tileflight::mapping::normal_equations_test {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

void expect_schur_solution_is_the_dense_one(keyframes::Window window) {
  const auto pairs = make_host_target_pairs(window);
  const auto points = all_points(window);
  const NormalEquations dense = test_support::dense_equations(window, pairs, points);
  const NormalEquations reduced = build_normal_equations(window, pairs, points, 0.0);
  const int n = window.unknowns();
  const MatrixXd H_pp = dense.H.bottomRightCorner(points.size(), points.size());
  EXPECT_LT((H_pp - MatrixXd(H_pp.diagonal().asDiagonal())).norm(), 1e-12);
  // Both systems are singular by the gauge: the same small damping on the keyframes' unknowns makes the solution
  // unique.
  MatrixXd full = dense.H, small = reduced.H;
  full.diagonal().head(n).array() += 1.0;
  small.diagonal().array() += 1.0;
  const VectorXd x_full = -full.ldlt().solve(dense.b), x = -small.ldlt().solve(reduced.b);
  // Points of a task are summed in float, tasks in double.
  EXPECT_LT((x - x_full.head(n)).norm(), 1e-4 * x_full.head(n).norm());
  back_substitute(window, pairs, points, x_full.head(n), 0.0);
  for (std::size_t i = 0; i < points.size(); ++i) {
    EXPECT_NEAR(window.keyframes[points[i].host].points[points[i].index].step, x_full[n + static_cast<int>(i)], 1e-4);
  }
}

TEST(NormalEquations, SchurSolutionIsTheDenseOne) {
  expect_schur_solution_is_the_dense_one(test_support::random_window(4, 25, 1));
}

TEST(NormalEquations, SchurSolutionIsTheDenseOneWithTheLens) {
  expect_schur_solution_is_the_dense_one(test_support::random_window(4, 25, 1, true));
}

TEST(NormalEquations, SchurSolutionIsTheDenseOneWithStereoPictures) {
  expect_schur_solution_is_the_dense_one(test_support::random_window(4, 25, 1, false, 1));
  expect_schur_solution_is_the_dense_one(test_support::random_window(3, 40, 8, false, 4));
}

TEST(NormalEquations, SkipObservationsThatAreNotGood) {
  keyframes::Window window = test_support::random_window(3, 10, 2);
  const auto pairs = make_host_target_pairs(window);
  keyframes::Window without = window;
  for (keyframes::Keyframe& keyframe : window.keyframes)
    keyframe.points[0].observations[1].state = keyframes::ResidualState::kOutlier;
  for (keyframes::Keyframe& keyframe : without.keyframes)
    keyframe.points[0].observations.erase(keyframe.points[0].observations.begin() + 1);
  const auto a = build_normal_equations(window, pairs, all_points(window), 0.0);
  const auto b = build_normal_equations(without, pairs, all_points(without), 0.0);
  EXPECT_TRUE(a.H == b.H && a.b == b.b);
}

TEST(NormalEquations, AreTheSameForAnyNumberOfThreads) {
  keyframes::Window window = test_support::random_window(5, 300, 3);
  const auto pairs = make_host_target_pairs(window);
  const auto points = all_points(window);
  const auto build = [&](int threads) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    return build_normal_equations(window, pairs, points, 1e-3);
  };
  const auto one = build(1), four = build(4);
  EXPECT_TRUE(one.H == four.H && one.b == four.b);
}

TEST(Gauge, MovesNoRelativePoseAndProjectsAway) {
  const keyframes::Window window = test_support::random_window(4, 0, 4);
  const MatrixXd N = gauge_nullspace(window);
  const auto pairs = make_host_target_pairs(window);
  for (int h = 0; h < window.size(); ++h) {
    for (int t = 0; t < window.size(); ++t) {
      if (h == t) continue;
      const MatrixXd relative =
          N.middleRows<8>(8 * t) + pairs[h * window.size() + t].d_relative_d_host * N.middleRows<8>(8 * h);
      EXPECT_LT(relative.leftCols<6>().norm(), 1e-6);  // the map frame
      // A change of scale moves the relative translation along itself.
      const geometry::SE3 T = window.keyframes[t].T_camera_map() * window.keyframes[h].T_camera_map().inverse();
      EXPECT_LT((relative.block<3, 1>(0, 6) - T.translation).norm(), 1e-6);
      EXPECT_LT((relative.block<3, 1>(3, 6)).norm(), 1e-6);
    }
  }
  const VectorXd x = VectorXd::LinSpaced(32, -1.0, 1.0);
  EXPECT_LT((N.transpose() * remove_gauge_component(x, N)).norm(), 1e-9);
  EXPECT_LT(remove_gauge_component(N.col(2) - 2 * N.col(6), N).norm(), 1e-9);
}

void expect_marginalization_keeps_the_solution(keyframes::Window window) {
  const auto pairs = make_host_target_pairs(window);
  const auto points = all_points(window);
  const int n = window.unknowns(), kept = n - 8;
  // Full problem: all unknowns, with the brightness prior and some damping against the gauge.
  window.H_prior.diagonal().array() += 1.0;
  NormalEquations full = test_support::dense_equations(window, pairs, points);
  full.H.topLeftCorner(n, n) += window.H_prior;
  full.b.head(n) += window.b_prior;
  const VectorXd x_full = -full.H.ldlt().solve(full.b);
  // Marginalises keyframe 0's points, then keyframe 0 itself; the others keep no residual in it.
  std::vector<PointRef> of_first, of_others;
  for (const PointRef& p : points) (p.host == 0 ? of_first : of_others).push_back(p);
  marginalize_points(window, pairs, of_first, 1.0);
  marginalize_points(window, pairs, of_others, 1.0);
  const QuadraticPrior prior = marginalize_keyframe({window.H_prior, window.b_prior}, 0);
  const VectorXd x = -prior.H.ldlt().solve(prior.b);
  EXPECT_LT((x - x_full.segment(8, kept)).norm(), 1e-4 * x_full.head(n).norm());
}

TEST(Marginalization, PointsAndAKeyframeLeaveTheSolutionOfTheFullProblem) {
  expect_marginalization_keeps_the_solution(test_support::random_window(4, 20, 5));
}

TEST(Marginalization, PointsAndAKeyframeLeaveTheSolutionOfTheFullProblemWithTheLens) {
  expect_marginalization_keeps_the_solution(test_support::random_window(4, 20, 5, true));
}

TEST(Marginalization, PointsAndAKeyframeLeaveTheSolutionOfTheFullProblemWithStereoPictures) {
  keyframes::Window window = test_support::random_window(4, 20, 5, false, 2);
  const auto pairs = make_host_target_pairs(window);
  const auto points = all_points(window);
  const int n = window.unknowns();
  window.H_prior.diagonal().array() += 1.0;
  NormalEquations full = test_support::dense_equations(window, pairs, points);
  full.H.topLeftCorner(n, n) += window.H_prior;
  full.b.head(n) += window.b_prior;
  const VectorXd x_full = -full.H.ldlt().solve(full.b);
  marginalize_points(window, pairs, points, 1.0);
  for (keyframes::Keyframe& keyframe : window.keyframes) keyframe.points.clear();
  remove_keyframe(window, 0);
  ASSERT_EQ(window.H_prior.rows(), window.unknowns());
  const VectorXd x = -window.H_prior.ldlt().solve(window.b_prior);
  VectorXd expected(window.unknowns());
  expected << x_full.segment(8, 24), x_full.segment(40, 24);  // keyframes 1 to 3, and their stereo pictures
  EXPECT_LT((x - expected).norm(), 1e-4 * expected.norm());
}

TEST(Marginalization, LinearisesStereoPicturesAboutTheFirstEstimate) {
  keyframes::Window at_zero = test_support::random_window(3, 15, 6, false, 2), moved = at_zero;
  const auto pairs = make_host_target_pairs(at_zero);
  for (keyframes::Keyframe& keyframe : moved.keyframes) {
    keyframe.stereo_delta = 0.01 * keyframes::Vec8::Random();
    for (keyframes::ActivePoint& point : keyframe.points) {
      for (keyframes::Observation& o : point.stereo_observations) {
        const Eigen::Vector2f light = keyframe.stereo_delta.segment<2>(2 * o.target).cast<float>();
        o.linearization.sums.gr += o.linearization.sums.gA * light;
        o.linearization.sums.Ar += o.linearization.sums.AA * light;
      }
    }
  }
  marginalize_points(at_zero, pairs, all_points(at_zero), 1.0);
  marginalize_points(moved, pairs, all_points(moved), 1.0);
  EXPECT_LT((at_zero.H_prior - moved.H_prior).norm(), 1e-9 * at_zero.H_prior.norm());
  EXPECT_LT((at_zero.b_prior - moved.b_prior).norm(), 1e-4 * at_zero.b_prior.norm());
}

TEST(Marginalization, ReversingTheKeyframesTakesTheirStereoPicturesAlong) {
  constexpr int kKeyframes = 3;
  keyframes::Window window = test_support::random_window(kKeyframes, 9, 5, false, 2);
  const VectorXd prior = window.H_prior.diagonal(), b = window.b_prior;
  for (int i = 0; i < window.unknowns(); ++i) window.H_prior(i, i) += i;
  reverse_keyframes(window);
  for (int block = 0; block < 2 * kKeyframes; ++block) {
    const int from = block < kKeyframes ? kKeyframes - 1 - block : 3 * kKeyframes - 1 - block;
    for (int i = 0; i < 8; ++i) {
      EXPECT_EQ(window.H_prior(8 * block + i, 8 * block + i), prior[8 * from + i] + 8 * from + i);
      EXPECT_EQ(window.b_prior[8 * block + i], b[8 * from + i]);
    }
  }
}

TEST(Marginalization, LinearisesAboutTheFirstEstimate) {
  // Residuals measured at delta are extrapolated linearly to zero: the prior must have the same minimum as one made at
  // zero.
  keyframes::Window at_zero = test_support::random_window(3, 15, 6, true), moved = at_zero;
  const auto pairs = make_host_target_pairs(at_zero);
  std::mt19937 random(9);
  for (keyframes::Keyframe& keyframe : moved.keyframes) keyframe.delta = 0.01 * keyframes::Vec8::Random();
  moved.intrinsics.delta = keyframes::IntrinsicsDelta(0.01, -0.005, 0.002, 0.008);
  for (int h = 0; h < moved.size(); ++h) {
    for (keyframes::ActivePoint& point : moved.keyframes[h].points) {
      for (keyframes::Observation& o : point.observations) {
        const keyframes::Vec8 d =
            moved.keyframes[o.target].delta + pairs[h * 3 + o.target].d_relative_d_host * moved.keyframes[h].delta;
        const Eigen::Vector2f pixel = (o.linearization.d_pixel_d_pose.cast<double>() * d.head<6>() +
                                       o.linearization.d_pixel_d_intrinsics.cast<double>() * moved.intrinsics.delta)
                                          .cast<float>(),
                              light = d.tail<2>().cast<float>();
        keyframes::PatternSums& s = o.linearization.sums;
        s.gr += s.gg * pixel + s.gA * light;
        s.Ar += s.gA.transpose() * pixel + s.AA * light;
      }
    }
  }
  marginalize_points(at_zero, pairs, all_points(at_zero), 1.0);
  marginalize_points(moved, pairs, all_points(moved), 1.0);
  EXPECT_LT((at_zero.H_prior - moved.H_prior).norm(), 1e-9 * at_zero.H_prior.norm());
  EXPECT_LT((at_zero.b_prior - moved.b_prior).norm(), 1e-4 * at_zero.b_prior.norm());
}

TEST(Marginalization, ReversingTheKeyframesPermutesTheSystemAndKeepsThePriorsEnergy) {
  constexpr int kKeyframes = 4;
  keyframes::Window window = test_support::random_window(kKeyframes, 9, 5, true);
  std::mt19937 random(6);
  window.H_prior =
      MatrixXd::NullaryExpr(window.unknowns(), window.unknowns(), [&] { return std::normal_distribution<>()(random); });
  window.H_prior = (window.H_prior * window.H_prior.transpose()).eval();
  window.b_prior = VectorXd::NullaryExpr(window.unknowns(), [&] { return std::normal_distribution<>()(random); });
  const auto system_of = [](keyframes::Window& w) {
    return build_normal_equations(w, make_host_target_pairs(w), all_points(w), 0.0);
  };
  const auto energy_of = [](const keyframes::Window& w) {
    const VectorXd delta = stacked_delta(w);
    return delta.dot(w.H_prior * delta) + 2.0 * w.b_prior.dot(delta);
  };
  for (keyframes::Keyframe& keyframe : window.keyframes) keyframe.delta = 0.01 * keyframes::Vec8::Random();
  window.intrinsics.delta = 0.01 * keyframes::IntrinsicsDelta::Random();
  keyframes::Window reversed = window;
  reverse_keyframes(reversed);
  EXPECT_NEAR(energy_of(reversed), energy_of(window), 1e-9 * std::abs(energy_of(window)));
  const NormalEquations before = system_of(window), after = system_of(reversed);
  const auto position = [&](int unknown) {
    return unknown < 8 * kKeyframes ? 8 * (kKeyframes - 1 - unknown / 8) + unknown % 8 : unknown;
  };
  for (int i = 0; i < window.unknowns(); ++i) {
    EXPECT_NEAR(after.b[position(i)], before.b[i], 1e-4 * before.b.cwiseAbs().maxCoeff());
    for (int j = 0; j < window.unknowns(); ++j)
      EXPECT_NEAR(after.H(position(i), position(j)), before.H(i, j), 1e-4 * before.H.cwiseAbs().maxCoeff());
  }
}

TEST(Marginalization, RemovingAKeyframeRenumbersObservations) {
  keyframes::Window window = test_support::random_window(4, 3, 7);
  window.keyframes[1].points.clear();
  remove_keyframe(window, 1);
  ASSERT_EQ(window.size(), 3);
  EXPECT_EQ(window.H_prior.rows(), 24);
  std::size_t points = 0;
  for (int h = 0; h < 3; ++h) {
    for (const keyframes::ActivePoint& point : window.keyframes[h].points) {
      ++points;
      ASSERT_EQ(point.observations.size(), 2U);
      for (const keyframes::Observation& o : point.observations)
        EXPECT_TRUE(o.target >= 0 && o.target < 3 && o.target != h);
    }
  }
  EXPECT_GT(points, 0U);
}

}  // namespace
}  // namespace tileflight::mapping::normal_equations_test
