#include "tileflight/world/ground_truth/surface_samples.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include "tileflight/core/base/input_error.h"

namespace tileflight::ground_truth::surface_samples_test {
namespace {

using geometry::Box3;
using geometry::PointCloud;
using geometry::TriangleMesh;
using geometry::Vec3;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

void add_rectangle(TriangleMesh& mesh, const Vec3& corner, const Vec3& side_a, const Vec3& side_b) {
  const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
  for (const Vec3& v : {corner, Vec3(corner + side_a), Vec3(corner + side_a + side_b), Vec3(corner + side_b)}) {
    mesh.vertices.push_back(v);
  }
  mesh.triangles.push_back({first, first + 1, first + 2});
  mesh.triangles.push_back({first, first + 2, first + 3});
}

const Box3 kEverywhere(Vec3::Constant(-1e4), Vec3::Constant(1e4));

TEST(SampleSurface, CountIsAreaTimesDensityAndPointsLieOnTheSurface) {
  TriangleMesh mesh;
  add_rectangle(mesh, Vec3(1, 2, 3), Vec3(10, 0, 5), Vec3(0, 7, 0));
  const double area_m2 = geometry::surface_area_m2(mesh);
  const PointCloud cloud = sample_surface(mesh, kEverywhere, 20.0);
  EXPECT_NEAR(static_cast<double>(cloud.size()), 20.0 * area_m2, 2.0);
  const Vec3 normal = Vec3(-5, 0, 10).normalized();
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    EXPECT_NEAR(normal.dot(cloud.positions[i] - Vec3(1, 2, 3)), 0.0, 1e-12);
    EXPECT_LT((cloud.normals[i].cast<double>() - normal).norm(), 1e-6);
  }
}

TEST(SampleSurface, IsEvenByArea) {
  // A big square of two triangles beside one of many small triangles: every quarter square metre gets its share.
  TriangleMesh mesh;
  add_rectangle(mesh, Vec3(0, 0, 0), Vec3(8, 0, 0), Vec3(0, 8, 0));
  for (int i = 0; i < 32 * 32; ++i) {
    add_rectangle(mesh, Vec3(8 + 0.25 * (i % 32), 0.25 * (i / 32), 0), Vec3(0.25, 0, 0), Vec3(0, 0.25, 0));
  }
  const PointCloud cloud = sample_surface(mesh, kEverywhere, 400.0);
  std::vector<double> bins(16 * 8, 0.0);
  for (const Vec3& p : cloud.positions) {
    bins[static_cast<std::size_t>(std::floor(p.x()) + 16 * std::floor(p.y()))] += 1.0;
  }
  // Chi-square with 127 degrees of freedom; even without any stratification it exceeds 200 in 4 of 100 000 cases.
  double chi2 = 0.0;
  for (const double count : bins) chi2 += (count - 400.0) * (count - 400.0) / 400.0;
  EXPECT_LT(chi2, 200.0);
}

TEST(SampleSurface, ClippedToTheBoxWithTheSameDensity) {
  TriangleMesh mesh;
  add_rectangle(mesh, Vec3(-50, -50, 0), Vec3(100, 0, 0), Vec3(0, 100, 0));
  const Box3 box(Vec3(-2, -3, -1), Vec3(4, 3, 1));
  const PointCloud cloud = sample_surface(mesh, box, 50.0);
  EXPECT_NEAR(static_cast<double>(cloud.size()), 50.0 * 36.0, 2.0);
  for (const Vec3& p : cloud.positions) EXPECT_LT(box.exteriorDistance(p), 1e-12);
  EXPECT_TRUE(sample_surface(mesh, Box3(Vec3(0, 0, 5), Vec3(1, 1, 6)), 50.0).empty());
}

TEST(SampleSurface, NearAPartTheyAreTheSame) {
  TriangleMesh mesh;
  for (int i = 0; i < 40; ++i)
    add_rectangle(mesh, Vec3(i % 8, i / 8, 0.1 * i), Vec3(0.9, 0, 0.1 * (i % 3)), Vec3(0, 0.7, 0));
  const Box3 box(Vec3(0.3, 0.3, -1), Vec3(7, 4.5, 9)), part(Vec3(2, 1, 0), Vec3(4.2, 3.1, 2));
  const PointCloud all = sample_surface(mesh, box, 37.0, 5), near = sample_surface_near(mesh, box, part, 37.0, 5);
  EXPECT_LT(near.size(), all.size());
  std::size_t k = 0;
  for (std::size_t i = 0; i < all.size(); ++i) {
    const bool taken = k < near.size() && near.positions[k] == all.positions[i];
    if (taken) {
      EXPECT_EQ(near.normals[k], all.normals[i]);
      ++k;
    }
    EXPECT_TRUE(taken || !part.contains(all.positions[i]));
  }
  EXPECT_EQ(k, near.size());
  EXPECT_TRUE(sample_surface_near(mesh, box, Box3(), 37.0, 5).empty());
  EXPECT_EQ(sample_surface_near(mesh, box, box, 37.0, 5).positions, all.positions);
}

TEST(SampleSurface, TheSeedDecides) {
  TriangleMesh mesh;
  add_rectangle(mesh, Vec3(0, 0, 0), Vec3(5, 0, 0), Vec3(0, 5, 0));
  EXPECT_EQ(sample_surface(mesh, kEverywhere, 10.0, 7).positions, sample_surface(mesh, kEverywhere, 10.0, 7).positions);
  EXPECT_NE(sample_surface(mesh, kEverywhere, 10.0, 7).positions, sample_surface(mesh, kEverywhere, 10.0, 8).positions);
}

TEST(SampleSurface, TrianglesWithoutAreaGetNothing) {
  const TriangleMesh mesh{{{0, 0, 0}, {1, 1, 1}, {2, 2, 2}}, {{0, 1, 2}, {0, 0, 0}}};
  EXPECT_TRUE(sample_surface(mesh, kEverywhere, 100.0).empty());
  EXPECT_TRUE(sample_surface({}, kEverywhere, 100.0).empty());
}

TEST(SampleSurface, BadInputIsNamed) {
  TriangleMesh mesh;
  add_rectangle(mesh, Vec3(0, 0, 0), Vec3(1000, 0, 0), Vec3(0, 1000, 0));
  EXPECT_THAT([&] { sample_surface(mesh, kEverywhere, 0.0); }, ThrowsMessage<InputError>(HasSubstr("above zero")));
  EXPECT_THAT([&] { sample_surface(mesh, kEverywhere, std::nan("")); },
              ThrowsMessage<InputError>(HasSubstr("above zero")));
  EXPECT_THAT([&] { sample_surface(mesh, kEverywhere, 1e6); },
              ThrowsMessage<InputError>(HasSubstr("more than 500 million")));
  EXPECT_THAT([&] { sample_surface(mesh, Box3(), 1.0); }, ThrowsMessage<InputError>(HasSubstr("region: is empty")));
  mesh.vertices[1].z() = HUGE_VAL;
  EXPECT_THAT([&] { sample_surface(mesh, kEverywhere, 1.0); },
              ThrowsMessage<InputError>(HasSubstr("vertex 1: is not finite")));
}

/// Looking straight down from `height_m` above (x, y): image right is east, image down is south.
geometry::StampedPose looking_down(double time_s, double x, double y, double height_m) {
  geometry::Mat3 rotation;
  rotation << 1, 0, 0, 0, -1, 0, 0, 0, -1;
  return {time_s, geometry::SE3(rotation, Vec3(x, y, height_m))};
}

scene::Scene scene_of(const TriangleMesh& mesh) {
  imaging::TexturedMesh textured;
  textured.mesh = mesh;
  return scene::Scene({textured});
}

TEST(SeenByCamera, APinholeAboveAPlaneSeesItsFootprint) {
  TriangleMesh mesh;
  add_rectangle(mesh, Vec3(-50, -50, 0), Vec3(100, 0, 0), Vec3(0, 100, 0));
  const PointCloud points = sample_surface(mesh, kEverywhere, 1.0);
  const auto camera = imaging::make_pinhole(200, 100, 90.0);
  const auto seen = compute_visibility(scene_of(mesh), points, {{looking_down(0, 5, 0, 20)}}, camera);
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Vec3& p = points.positions[i];
    const double outside = std::max(std::abs(p.x() - 5) - 20.0, std::abs(p.y()) - 10.0);
    if (std::abs(outside) < 0.2) continue;
    EXPECT_EQ(seen[i], outside < 0.0) << p.transpose();
  }
}

TEST(SeenByCamera, WhatARoofHidesIsNotSeenUnlessFromAnotherPose) {
  TriangleMesh mesh;
  add_rectangle(mesh, Vec3(-50, -50, 0), Vec3(100, 0, 0), Vec3(0, 100, 0));
  add_rectangle(mesh, Vec3(-5, -5, 5), Vec3(10, 0, 0), Vec3(0, 10, 0));
  const PointCloud points{{Vec3(0, 0, 0), Vec3(0, 0, 5), Vec3(9, 0, 0), Vec3(4.5, 0, 0)}, {}, {}, {}};
  const auto camera = imaging::make_fisheye(300, 200, 155.0);
  const scene::Scene scene = scene_of(mesh);
  EXPECT_EQ(compute_visibility(scene, points, {{looking_down(0, 0, 0, 20)}}, camera),
            (std::vector<bool>{false, true, true, false}));
  EXPECT_EQ(compute_visibility(scene, points, {{looking_down(0, 0, 0, 20), looking_down(1, 12, 0, 20)}}, camera),
            (std::vector<bool>{false, true, true, true}));
  EXPECT_EQ(compute_visibility(scene, points, {{looking_down(0, 0, 0, 20)}}, camera, 16.0),
            (std::vector<bool>{false, true, false, false}));
  EXPECT_EQ(compute_visibility(scene, points, {}, camera), std::vector<bool>(4, false));
}

TEST(SeenByCamera, WhatLiesBehindAPinholeIsNotSeen) {
  TriangleMesh mesh;
  add_rectangle(mesh, Vec3(-50, -50, 40), Vec3(100, 0, 0), Vec3(0, 100, 0));
  const PointCloud points{{Vec3(0, 0, 40)}, {}, {}, {}};
  EXPECT_FALSE(
      compute_visibility(scene_of(mesh), points, {{looking_down(0, 0, 0, 20)}}, imaging::make_pinhole(64, 64, 120))[0]);
}

TEST(SeenByCamera, AsAskedPointByPointAndPoseByPose) {
  TriangleMesh mesh;
  add_rectangle(mesh, Vec3(-200, -200, 0), Vec3(400, 0, 0), Vec3(0, 400, 0));
  for (int i = 0; i < 60; ++i)
    add_rectangle(mesh, Vec3(6.0 * i - 180, 37.0 * (i % 9) - 160, 4), Vec3(3, 0, 1), Vec3(0, 9, 0));
  const PointCloud points = sample_surface(mesh, kEverywhere, 0.1);
  geometry::Trajectory poses;
  for (int i = 0; i < 12; ++i) {
    poses.poses.push_back(looking_down(i, 30.0 * i - 180, 3.0 * i, 8 + i));
    geometry::SE3& T = poses.poses.back().T_local_camera;  // turned about the camera's x by up to 110 degrees
    T = T * geometry::SE3(geometry::so3_exp({0.175 * i, 0, 0}), Vec3::Zero());
  }
  const scene::Scene scene = scene_of(mesh);
  for (const auto& camera : {imaging::make_pinhole(200, 100, 70.0), imaging::make_fisheye(300, 200, 200.0)}) {
    const auto seen = compute_visibility(scene, points, poses, camera, 90.0, 0.05);
    for (std::size_t i = 0; i < points.size(); ++i) {
      const Vec3& p = points.positions[i];
      const bool expected = std::ranges::any_of(poses.poses, [&](const geometry::StampedPose& pose) {
        const Vec3 offset = p - pose.T_local_camera.translation;
        const auto pixel = camera.project(pose.T_local_camera.inverse() * p);
        return offset.norm() < 90.0 && pixel && pixel->x() >= -0.5 && pixel->y() >= -0.5 &&
               pixel->x() < camera.width() - 0.5 && pixel->y() < camera.height() - 0.5 &&
               !scene.is_occluded({pose.T_local_camera.translation, offset.normalized()}, offset.norm() - 0.05);
      });
      EXPECT_EQ(seen[i], expected) << p.transpose();
    }
    EXPECT_GT(std::count(seen.begin(), seen.end(), true), 1000);
    EXPECT_GT(std::count(seen.begin(), seen.end(), false), 1000);
  }
}

TEST(SeenByCamera, ReachHoldsWhatIsSeen) {
  const geometry::Trajectory poses{{looking_down(0, 5, -7, 20), looking_down(1, 15, -7, 30)}};
  const Box3 box = view_range_bounds(poses, 100.0);
  EXPECT_EQ(box.min(), Vec3(-95, -107, -80));
  EXPECT_EQ(box.max(), Vec3(115, 93, 130));
  EXPECT_TRUE(view_range_bounds({}).isEmpty());
}

TEST(SeenByCamera, SameAnswerForAnyNumberOfThreads) {
  TriangleMesh mesh;
  add_rectangle(mesh, Vec3(-50, -50, 0), Vec3(100, 0, 0), Vec3(0, 100, 0));
  for (int i = 0; i < 20; ++i) add_rectangle(mesh, Vec3(4.0 * i - 40, 0.5 * i, 3), Vec3(2, 0, 1), Vec3(0, 9, 0));
  const PointCloud points = sample_surface(mesh, kEverywhere, 2.0);
  geometry::Trajectory poses;
  for (int i = 0; i < 10; ++i) poses.poses.push_back(looking_down(i, 6.0 * i - 30, i, 15));
  const auto camera = imaging::make_fisheye(300, 200, 120.0);
  const scene::Scene scene = scene_of(mesh);
  const auto parallel = compute_visibility(scene, points, poses, camera);
  const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
  EXPECT_EQ(compute_visibility(scene, points, poses, camera), parallel);
  EXPECT_GT(std::count(parallel.begin(), parallel.end(), true), 100);
  EXPECT_GT(std::count(parallel.begin(), parallel.end(), false), 100);
}

}  // namespace
}  // namespace tileflight::ground_truth::surface_samples_test
