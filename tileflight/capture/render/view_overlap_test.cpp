#include "tileflight/capture/render/view_overlap.h"

#include <gmock/gmock.h>

#include "tests/refusal.h"
#include "tileflight/capture/render/test_scenes.h"

namespace tileflight::render::view_overlap_test {
namespace {

using geometry::SE3;
using geometry::Vec3;
using test_scenes::ground;
using test_scenes::looking_down;

/// 90 degrees across a square image: from 10 m above level ground it sees a square with sides of 20 m.
const imaging::Camera kSquare = imaging::make_pinhole(200, 200, 90);

scene::Scene level_ground() { return scene::Scene({ground(Vec3::Zero(), 1000, nullptr)}); }

TEST(ViewOverlap, OfOneViewIsAll) {
  const scene::Scene scene = level_ground();
  const ViewOverlap overlap(scene, kSquare, kSquare);
  EXPECT_EQ(overlap(looking_down({3, 4, 10}), looking_down({3, 4, 10})), 1.0);
}

TEST(ViewOverlap, OfTwoPlacesIsWhatTheSquaresShare) {
  const scene::Scene scene = level_ground();
  const ViewOverlap overlap(scene, kSquare, kSquare, 100);
  for (const double shift_m : {0.0, 5.0, 10.0, 15.0, 25.0}) {
    const double wanted = std::max(0.0, (20 - shift_m) / 20);
    EXPECT_NEAR(overlap(looking_down({0, 0, 10}), looking_down({shift_m, 0, 10})), wanted, 0.011) << shift_m;
  }
  // From twice the height, all of the lower view is seen, and a quarter of the upper one.
  EXPECT_NEAR(overlap(looking_down({0, 0, 10}), looking_down({0, 0, 20})), (1 + 0.25) / 2, 0.011);
}

TEST(ViewOverlap, IsSymmetricForTwoLenses) {
  const scene::Scene scene({test_scenes::hills({0, 0, 0}, 200, 60, nullptr)});
  const imaging::Camera fisheye = imaging::make_fisheye(320, 180, 155);
  const SE3 from = looking_down({0, 0, 30}), to = test_scenes::looking_along({20, 5, 25}, {-1, 0.2, -0.8});
  const double there = ViewOverlap(scene, kSquare, fisheye)(from, to);
  EXPECT_DOUBLE_EQ(ViewOverlap(scene, fisheye, kSquare)(to, from), there);
  EXPECT_GT(there, 0.2);
  EXPECT_LT(there, 0.9);
}

TEST(ViewOverlap, WhatIsHiddenIsNotShared) {
  // A wide sheet halfway up occludes the ground from the upper view, but not from the one below it.
  const scene::Scene scene({ground(Vec3::Zero(), 1000, nullptr), ground({0, 0, 20}, 500, nullptr)});
  const ViewOverlap overlap(scene, kSquare, kSquare);
  EXPECT_EQ(overlap(looking_down({0, 0, 10}), looking_down({0, 0, 30})), 0.0);
  EXPECT_EQ(overlap(looking_down({0, 0, 10}), looking_down({0, 0, 10})), 1.0);
}

TEST(ViewOverlap, WithoutSurfaceThereIsNone) {
  const scene::Scene scene = level_ground();
  const SE3 up = test_scenes::looking_along({0, 0, 10}, {0.1, 0, 1});
  EXPECT_EQ(ViewOverlap(scene, kSquare, kSquare)(up, up), 0.0);
  EXPECT_THAT(tests::refusal_of([&] { ViewOverlap(scene, kSquare, kSquare, 1); }), testing::HasSubstr("too coarse"));
}

}  // namespace
}  // namespace tileflight::render::view_overlap_test
