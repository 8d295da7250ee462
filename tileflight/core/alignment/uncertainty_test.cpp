#include "tileflight/core/alignment/uncertainty.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "tests/height_field.h"
#include "tileflight/core/alignment/align_globally.h"
#include "tileflight/core/alignment/icp.h"

namespace tileflight::alignment::uncertainty_test {
namespace {

using geometry::PointCloud;
using geometry::Sim3;
using geometry::TriangleIndex;
using geometry::TriangleMesh;
using geometry::Vec3;

double hills_m(double x, double y) { return 4.0 * std::sin(0.21 * x) + 3.0 * std::cos(0.17 * y + 0.1 * x); }

/// Alignments of the same points with new noise each time: independent, or the same within each square of 5 m.
struct Repetitions {
  double rms_motion_m = 0.0;  ///< over the repetitions
  double scale_spread = 0.0;
  double predicted_motion_m = 0.0, predicted_scale = 0.0;  ///< mean of the predicted values

  Repetitions(bool by_squares, std::size_t count) {
    const TriangleMesh mesh = tests::height_field(60, -30.0, 60.0, hills_m);
    const TriangleIndex index(mesh);
    const std::vector<Vec3> points = sample_surface_evenly(mesh, 1500);
    std::mt19937_64 random(21);
    std::normal_distribution<double> normal(0.0, 0.05);
    IcpOptions options = converging_icp_options();
    options.method = IcpMethod::kPointToMesh;
    for (std::size_t k = 0; k < count; ++k) {
      std::array<std::array<double, 12>, 12> of_square;
      for (auto& row : of_square) {
        for (double& value : row) value = normal(random);
      }
      PointCloud noisy;
      for (const Vec3& p : points) {
        const auto i = static_cast<std::size_t>((p.x() + 30.0) / 5.0),
                   j = static_cast<std::size_t>((p.y() + 30.0) / 5.0);
        noisy.positions.push_back(p + Vec3(0, 0,
                                           by_squares
                                               ? of_square[std::min(i, std::size_t{11})][std::min(j, std::size_t{11})]
                                               : normal(random)));
      }
      const IcpResult result = icp(noisy, index, mesh, Sim3(), options);
      double squares = 0.0;
      for (const Vec3& p : points) squares += (result.T_target_source * p - p).squaredNorm();
      const auto n = static_cast<double>(count);
      rms_motion_m += squares / static_cast<double>(points.size()) / n;
      scale_spread += std::pow(result.T_target_source.scale - 1.0, 2) / n;
      predicted_motion_m += std::pow(result.uncertainty->rms_motion_sigma_m, 2) / n;
      predicted_scale += std::pow(result.uncertainty->scale_sigma, 2) / n;
    }
    for (double* value : {&rms_motion_m, &scale_spread, &predicted_motion_m, &predicted_scale})
      *value = std::sqrt(*value);
  }
};

TEST(AlignmentUncertainty, IsTheSpreadOfRepeatedAlignments) {
  const Repetitions r(false, 100);
  EXPECT_NEAR(r.predicted_motion_m / r.rms_motion_m, 1.0, 0.25);
  EXPECT_NEAR(r.predicted_scale / r.scale_spread, 1.0, 0.25);
}

TEST(AlignmentUncertainty, NeighboursThatErrAlikeCountOnce) {
  const Repetitions alone(false, 30), alike(true, 100);
  EXPECT_GT(alike.rms_motion_m, 2.0 * alone.rms_motion_m) << "ten points a square say one thing";
  EXPECT_NEAR(alike.predicted_motion_m / alike.rms_motion_m, 1.0, 0.3) << "cubes of 5 m lie askew to the squares";
  EXPECT_NEAR(alike.predicted_scale / alike.scale_spread, 1.0, 0.35);
}

TEST(AlignmentUncertainty, OfASampleIsThatOfAll) {
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal(0.0, 1.0);
  std::vector<MatchedPlane> all, some;
  PointSpread spread;
  for (int k = 0; k < 40000; ++k) {
    const Vec3 p = 20.0 * Vec3(normal(random), normal(random), normal(random));
    all.push_back({p, Vec3(normal(random), normal(random), normal(random)).normalized(), 0.1 * normal(random)});
    if (k % 10 == 0) some.push_back(all.back());
    spread.second_moment += p * p.transpose() / 40000.0;
  }
  UncertaintyOptions options;
  options.length_m = 35.0;
  const auto whole = estimate_uncertainty(all, spread, options);
  options.sampled_share = 0.1;
  const auto sampled = estimate_uncertainty(some, spread, options);
  ASSERT_TRUE(whole && sampled);
  // Closed form for independent residuals: sigma^2 / (n / 3) for each translation.
  EXPECT_NEAR(whole->translation_sigma_m.x(), 0.1 * std::sqrt(3.0 / 40000.0), 3e-4);
  EXPECT_NEAR(sampled->rms_motion_sigma_m / whole->rms_motion_sigma_m, 1.0, 0.5);
}

TEST(AlignmentUncertainty, NoneWhereAMotionIsOpen) {
  std::vector<MatchedPlane> plane;
  for (int k = 0; k < 100; ++k) plane.push_back({Vec3(k % 10, k / 10, 0.0), Vec3::UnitZ(), 0.01});
  EXPECT_FALSE(estimate_uncertainty(plane, {}, {}));
  EXPECT_FALSE(estimate_uncertainty({}, {}, {}));
}

}  // namespace
}  // namespace tileflight::alignment::uncertainty_test

namespace tileflight::alignment::jackknife_test {
namespace {

using geometry::Sim3;
using geometry::Vec3;

/// For a mean of n numbers the delete-one jackknife is exactly s / sqrt(n).
TEST(Jackknife, OfAMeanItIsTheStandardError) {
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  std::vector<double> x;
  for (int k = 0; k < 12; ++k) x.push_back(normal(random));
  double sum = 0.0, squares = 0.0;
  for (const double v : x) sum += v;
  for (const double v : x) squares += std::pow(v - sum / 12.0, 2);
  const auto shifted = [](double by) { return Sim3(1.0, Eigen::Quaterniond::Identity(), Vec3(by, 0, 0)); };
  const double sigma_m =
      jackknife_sigma_m(shifted(sum / 12.0), 12, {}, [&](std::size_t k) { return shifted((sum - x[k]) / 11.0); });
  EXPECT_NEAR(sigma_m, std::sqrt(squares / 11.0 / 12.0), 1e-12);
}

TEST(Jackknife, OneGroupTellsNothing) {
  EXPECT_TRUE(std::isnan(jackknife_sigma_m(Sim3(), 1, {}, [](std::size_t) { return Sim3(); })));
}

}  // namespace
}  // namespace tileflight::alignment::jackknife_test
