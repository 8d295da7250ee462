#include "tileflight/world/scene/clearance.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "tileflight/world/scene/test_shapes.h"

namespace tileflight::scene::clearance_test {
namespace {

using geometry::Vec3;
using imaging::TexturedMesh;
using test_shapes::height_field;

constexpr double kReach_m = 100.0;

TexturedMesh level_ground() {
  return height_field(10, 200.0, Vec3::Zero(), [](double, double) { return 0.0; });
}

enum class Open { kNone, kBottom };

/// An upright box, its fronts outwards.
TexturedMesh box(const Vec3& low, const Vec3& high, Open open = Open::kNone) {
  TexturedMesh mesh;
  for (int corner = 0; corner < 8; ++corner) {
    mesh.mesh.vertices.emplace_back((corner & 1) != 0 ? high.x() : low.x(), (corner & 2) != 0 ? high.y() : low.y(),
                                    (corner & 4) != 0 ? high.z() : low.z());
  }
  mesh.mesh.triangles = {{4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4}, {2, 6, 3},
                         {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  if (open == Open::kNone) mesh.mesh.triangles.insert(mesh.mesh.triangles.end(), {{0, 2, 1}, {1, 2, 3}});
  return mesh;
}

/// The upper part of a ball down to `lowest` (a fraction of its radius), open below: a tree crown as captured from
/// above.
TexturedMesh crown(const Vec3& center, double radius_m, double lowest) {
  constexpr int kAround = 24, kDown = 16;
  TexturedMesh mesh;
  for (int j = 0; j <= kDown; ++j) {
    const double z = 1.0 - (1.0 - lowest) * j / kDown, across = std::sqrt(std::max(0.0, 1.0 - z * z));
    for (int i = 0; i < kAround; ++i) {
      const double turn = 2 * M_PI * i / kAround;
      mesh.mesh.vertices.push_back(center + radius_m * Vec3(across * std::cos(turn), across * std::sin(turn), z));
    }
  }
  for (std::uint32_t j = 0; j < kDown; ++j) {
    for (std::uint32_t i = 0; i < kAround; ++i) {
      const std::uint32_t a = j * kAround + i, b = j * kAround + (i + 1) % kAround, c = a + kAround, d = b + kAround;
      mesh.mesh.triangles.push_back({a, c, b});
      mesh.mesh.triangles.push_back({b, c, d});
    }
  }
  return mesh;
}

Scene place(std::vector<TexturedMesh> things) {
  things.push_back(level_ground());
  return Scene(std::move(things));
}

TEST(Clearance, DistancesToABoxAreItsOwn) {
  const Scene scene({box({-2, -2, 0}, {2, 2, 4})});
  const auto at = [&](const Vec3& point) { return find_surroundings(scene, point, kReach_m); };
  EXPECT_NEAR(at({5, 0, 2}).clearance_m, 3.0, 1e-9);
  EXPECT_NEAR(at({5, 6, 2}).clearance_m, 5.0, 1e-9);
  EXPECT_NEAR(at({0, 0, 1.5}).clearance_m, 1.5, 1e-9);
  EXPECT_NEAR(at({1, 1, 10}).above_ground_m, 6.0, 1e-9);
  EXPECT_TRUE(std::isinf(at({5, 0, 2}).above_ground_m));
  EXPECT_TRUE(std::isinf(find_surroundings(scene, {50, 0, 2}, 10.0).clearance_m));
}

TEST(Clearance, DistancesAreThoseOfEveryTriangle) {
  const TexturedMesh hills = height_field(30, 120.0, Vec3(5000, -7000, 300),
                                          [](double x, double y) { return 8 * std::sin(x / 9) * std::cos(y / 7); });
  const Scene scene({hills});
  std::mt19937_64 random(3);
  for (int i = 0; i < 300; ++i) {
    const Vec3 point = Vec3(5000, -7000, 300) + test_shapes::uniform_vector(random, 70.0);
    double nearest_m = INFINITY;
    for (const geometry::Triangle& t : hills.mesh.triangles) {
      const auto& v = hills.mesh.vertices;
      nearest_m =
          std::min(nearest_m, (geometry::closest_point_on_triangle(point, v[t[0]], v[t[1]], v[t[2]]) - point).norm());
    }
    const auto found = scene.distance_to_surface_m(point, 1000.0);
    ASSERT_TRUE(found);
    EXPECT_NEAR(*found, nearest_m, 1e-9);
    EXPECT_EQ(scene.distance_to_surface_m(point, 0.999 * nearest_m), std::nullopt);
    EXPECT_TRUE(scene.distance_to_surface_m(point, 1.001 * nearest_m + 1e-6));
  }
}

TEST(Clearance, InsideAClosedBoxAndNotBesideIt) {
  const Scene scene = place({box({-5, -5, 0}, {5, 5, 8})});
  for (const Vec3& point : {Vec3(0, 0, 4), Vec3(4.9, -4.9, 0.1), Vec3(-4.9, 4.9, 7.9)})
    EXPECT_TRUE(find_surroundings(scene, point, kReach_m).inside) << point.transpose();
  for (const Vec3& point : {Vec3(5.1, 0, 4), Vec3(0, 0, 8.1), Vec3(-6, -6, 0.1), Vec3(0, 0, 60), Vec3(99, 99, 2)})
    EXPECT_FALSE(find_surroundings(scene, point, kReach_m).inside) << point.transpose();
}

TEST(Clearance, InsideAHouseThatIsOpenBelow) {
  const Scene scene = place({box({-5, -5, 0}, {5, 5, 8}, Open::kBottom)});
  EXPECT_TRUE(find_surroundings(scene, {0, 0, 4}, kReach_m).inside);
  EXPECT_TRUE(find_surroundings(scene, {3, 3, 1.5}, kReach_m).inside);
  EXPECT_FALSE(find_surroundings(scene, {0, 0, 8.5}, kReach_m).inside);
}

TEST(Clearance, BeneathTheGround) {
  const Scene scene = place({});
  EXPECT_TRUE(find_surroundings(scene, {0, 0, -0.5}, kReach_m).inside);
  EXPECT_TRUE(find_surroundings(scene, {20, 30, -15}, kReach_m).inside);
  EXPECT_FALSE(find_surroundings(scene, {0, 0, 0.5}, kReach_m).inside);
}

TEST(Clearance, InsideATreeButNotUnderIt) {
  const Scene scene = place({crown({0, 0, 8}, 4.0, -0.6)});
  EXPECT_TRUE(find_surroundings(scene, {0, 0, 8}, kReach_m).inside);
  EXPECT_TRUE(find_surroundings(scene, {2, 1, 9}, kReach_m).inside);
  EXPECT_FALSE(find_surroundings(scene, {0, 0, 1}, kReach_m).inside) << "under it";
  EXPECT_FALSE(find_surroundings(scene, {4.5, 0, 8}, kReach_m).inside) << "beside it";
}

TEST(Clearance, UnderABridgeThatWasOnlySeenFromAbove) {
  TexturedMesh deck;
  deck.mesh.vertices = {{-40, -4, 6}, {40, -4, 6}, {40, 4, 6}, {-40, 4, 6}};
  deck.mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  EXPECT_FALSE(find_surroundings(place({deck}), {0, 0, 2}, kReach_m).inside);
  EXPECT_FALSE(find_surroundings(place({deck}), {0, 0, 5}, kReach_m).inside);
}

TEST(Clearance, AScannedRoomIsToBeIn) {
  TexturedMesh room = box({-5, -5, 0}, {5, 5, 3});
  for (geometry::Triangle& t : room.mesh.triangles) std::swap(t[1], t[2]);
  EXPECT_FALSE(find_surroundings(Scene({room}), {1, 2, 1.5}, kReach_m).inside);
}

TEST(Clearance, GoesThroughAWallBetweenTwoPoints) {
  const Scene scene = place({box({10, -20, 0}, {10.2, 20, 10})});
  const std::vector<Vec3> through{{0, 0, 5}, {8, 0, 5}, {16, 0, 5}, {20, 0, 5}};
  EXPECT_TRUE(path_hits_surface(scene, through));
  for (const Vec3& at : through)
    EXPECT_FALSE(find_surroundings(scene, at, kReach_m).inside) << "each point is in the open";
  EXPECT_NEAR(find_surroundings(scene, through[1], kReach_m).clearance_m, 2.0, 1e-6);

  const std::vector<Vec3> over{{0, 0, 5}, {8, 0, 11}, {16, 0, 11}, {20, 0, 5}};
  EXPECT_FALSE(path_hits_surface(scene, over));
  const std::vector<Vec3> still{{0, 0, 5}, {0, 0, 5}};
  EXPECT_FALSE(path_hits_surface(scene, still));
  EXPECT_FALSE(path_hits_surface(scene, std::span<const Vec3>()));
}

TEST(Clearance, AFlightThatStartsInsideLeavesThroughTheWall) {
  const Scene scene = place({box({-5, -5, 0}, {5, 5, 8})});
  const std::vector<Vec3> path{{0, 0, 4}, {3, 0, 4}, {6, 0, 4}, {9, 0, 4}};
  EXPECT_TRUE(find_surroundings(scene, path[0], kReach_m).inside);
  EXPECT_TRUE(find_surroundings(scene, path[1], kReach_m).inside);
  EXPECT_FALSE(find_surroundings(scene, path[2], kReach_m).inside);
  EXPECT_FALSE(path_hits_surface(scene, std::span(path).first(2)));
  EXPECT_TRUE(path_hits_surface(scene, std::span(path).subspan(1, 2)));
  EXPECT_FALSE(path_hits_surface(scene, std::span(path).last(2)));
}

}  // namespace
}  // namespace tileflight::scene::clearance_test
