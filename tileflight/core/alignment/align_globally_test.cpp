#include "tileflight/core/alignment/align_globally.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "tests/height_field.h"
#include "tileflight/core/alignment/global_registration.h"
#include "tileflight/core/base/input_error.h"

namespace tileflight::alignment::align_globally_test {
namespace {

using geometry::PointCloud;
using geometry::Sim3;
using geometry::TriangleIndex;
using geometry::TriangleMesh;
using geometry::Vec3;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

/// Rolling ground with buildings of different sizes.
double height_m(double x, double y) {
  double z = 4.0 * std::sin(0.05 * x + 0.4) + 3.0 * std::cos(0.07 * y + 0.03 * x);
  struct Building {
    double x, y, east, north, up;
  };
  for (const Building& b : {Building{20, 10, 9, 5, 14},
                            {-35, 28, 6, 12, 7},
                            {8, -38, 15, 4, 10},
                            {-25, -22, 5, 5, 20},
                            {45, -30, 7, 7, 6},
                            {38, 44, 4, 11, 12},
                            {-48, -48, 8, 6, 9}}) {
    if (std::abs(x - b.x) < b.east && std::abs(y - b.y) < b.north) z += b.up;
  }
  return z;
}

/// As from odometry: points over a part of it, noise of 0.1 m, one in ten an outlier.
PointCloud map_points(const TriangleMesh& mesh) {
  std::mt19937_64 random(3);
  std::normal_distribution<double> noise(0.0, 0.1);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  PointCloud cloud;
  for (const Vec3& p : sample_surface_evenly(mesh, 9000)) {
    if (p.x() < -30.0 || p.y() > 45.0) continue;
    cloud.positions.push_back(p + Vec3(noise(random), noise(random), noise(random)));
    if (cloud.size() % 10 == 0) cloud.positions.back().z() += 15.0 * (unit(random) - 0.3);
  }
  return cloud;
}

class AlignGlobally : public ::testing::Test {
 protected:
  TriangleMesh mesh_ = tests::height_field(120, -60.0, 120.0, height_m);
  TriangleIndex index_{mesh_};
  PointCloud local_ = map_points(mesh_);
  AlignmentTarget target_{nullptr, &index_, &mesh_};

  double error_m(const Sim3& T, const PointCloud& map) const {
    double sum = 0.0;
    for (std::size_t i = 0; i < map.size(); ++i) sum += (T * map.positions[i] - local_.positions[i]).squaredNorm();
    return std::sqrt(sum / static_cast<double>(map.size()));
  }

  AlignMapOptions to_surface() const {
    AlignMapOptions options;
    options.icp.method = IcpMethod::kPointToMesh;
    return options;
  }
};

TEST_F(AlignGlobally, FindsPlaceTurnAndScaleFromTheShapesAlone) {
  std::mt19937_64 random(7);
  std::uniform_real_distribution<double> sign(-1.0, 1.0);
  for (int k = 0; k < 2; ++k) {
    const Sim3 T(std::exp(3.0 * sign(random)), geometry::so3_exp(3.0 * Vec3(sign(random), sign(random), sign(random))),
                 100.0 * Vec3(sign(random), sign(random), sign(random)));
    const PointCloud map = transformed(T.inverse(), local_);
    const Vec3 up = T.rotation.conjugate() * Vec3::UnitZ();
    const MapAlignment upright = align_map_globally(map, up, target_, to_surface());
    EXPECT_LT(error_m(upright.result.T_target_source, map), 0.1) << k << ": " << upright.result.note;
    EXPECT_TRUE(upright.result.converged);
    EXPECT_GT(*upright.closeness, 0.6);
    EXPECT_EQ(upright.result.note, "");
    if (k > 0) continue;
    const MapAlignment any = align_map_globally(map, std::nullopt, target_, to_surface());
    EXPECT_LT(error_m(any.result.T_target_source, map), 0.1) << k << " without gravity: " << any.result.note;
  }
}

TEST_F(AlignGlobally, ShrinkingGainsNoCloseness) {
  const double right = compute_closeness(local_, Sim3(), target_);
  EXPECT_GT(right, 0.6);
  const Sim3 tiny(0.01, Eigen::Quaterniond::Identity(), Vec3(0, 0, height_m(0, 0)));
  EXPECT_LT(compute_closeness(local_, tiny, target_), 0.5 * right) << "all of it lies within a metre of the ground";
}

TEST_F(AlignGlobally, AKnownScaleIsKept) {
  const Sim3 T(1.0, geometry::so3_exp({0.3, -0.2, 2.5}), {40.0, 10.0, -5.0});
  const PointCloud map = transformed(T.inverse(), local_);
  AlignMapOptions options = to_surface();
  options.icp.scale = ScaleMode::kFixed;
  const MapAlignment found = align_map_globally(map, std::nullopt, target_, options);
  EXPECT_DOUBLE_EQ(found.result.T_target_source.scale, 1.0);
  EXPECT_LT(error_m(found.result.T_target_source, map), 0.1) << found.result.note;
}

TEST(AlignGloballyInASymmetricPlace, SaysThatAnotherPlaceFitsAsWell) {
  // Half a turn about the vertical maps the place onto itself.
  const auto symmetric = [](double x, double y) { return height_m(x, y) + height_m(-x, -y); };
  const TriangleMesh mesh = tests::height_field(120, -60.0, 120.0, symmetric);
  const TriangleIndex index(mesh);
  PointCloud map;
  map.positions = sample_surface_evenly(mesh, 6000);
  AlignMapOptions options;
  options.icp.method = IcpMethod::kPointToMesh;
  const MapAlignment found = align_map_globally(map, Vec3::UnitZ(), {nullptr, &index, &mesh}, options);
  EXPECT_NE(found.result.note.find("another position"), std::string::npos) << found.result.note;
}

TEST_F(AlignGlobally, AMapOfSomethingElseDoesNotPass) {
  std::mt19937_64 random(9);
  std::normal_distribution<double> normal(0.0, 10.0);
  PointCloud ball;
  for (int k = 0; k < 1500; ++k) ball.positions.emplace_back(normal(random), normal(random), normal(random));
  try {
    const MapAlignment found = align_map_globally(ball, Vec3::UnitZ(), target_, to_surface());
    EXPECT_LT(*found.closeness, 0.3);
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("found no position"), std::string::npos);
  }
}

TEST(RegisterGlobally, RefusesBadInput) {
  const std::vector<Vec3> few = {{0, 0, 0}, {1, 0, 0}}, same(10, Vec3(1, 2, 3));
  std::vector<Vec3> bad = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, std::nan("")}};
  const std::vector<Vec3> good = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {2, 1, 4}};
  EXPECT_THAT([&] { register_globally(few, good); },
              ThrowsMessage<InputError>(HasSubstr("source cloud: has fewer than three points")));
  EXPECT_THAT([&] { register_globally(good, bad); },
              ThrowsMessage<InputError>(HasSubstr("target cloud: point 3 is not finite")));
  EXPECT_THAT([&] { register_globally(same, good); },
              ThrowsMessage<InputError>(HasSubstr("most of its points lie at one place")));
  EXPECT_THAT([&] { register_globally(good, good, {.min_scale = 2.0, .max_scale = 1.0}); },
              ThrowsMessage<InputError>(HasSubstr("scale range: must be two positive numbers")));
  EXPECT_TRUE(register_globally(good, good).candidates.empty()) << "five points tell nothing";
}

TEST(EvenSurfacePoints, AreEvenByArea) {
  TriangleMesh mesh;
  mesh.vertices = {{0, 0, 0}, {3, 0, 0}, {0, 2, 0}, {10, 0, 0}, {11, 0, 0}, {10, 2, 0}, {20, 0, 0}};
  mesh.triangles = {{0, 1, 2}, {3, 4, 5}, {6, 6, 6}};  // 3 and 1 square metres, and none
  const std::vector<Vec3> points = sample_surface_evenly(mesh, 400);
  EXPECT_NEAR(static_cast<double>(points.size()), 400.0, 1.0);
  std::size_t first = 0;
  Vec3 mean = Vec3::Zero();
  for (const Vec3& p : points) {
    if (p.x() > 5.0) continue;
    ++first;
    mean += p;
  }
  EXPECT_NEAR(static_cast<double>(first), 300.0, 1.0);
  EXPECT_LT((mean / static_cast<double>(first) - Vec3(1.0, 2.0 / 3.0, 0.0)).norm(), 0.03) << "the centroid";
  EXPECT_TRUE(sample_surface_evenly({}, 10).empty());
}

}  // namespace
}  // namespace tileflight::alignment::align_globally_test
