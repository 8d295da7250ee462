// A scene of parts against the scene of one tree over the same meshes: the same answers, to the last bit.
#include "tileflight/world/scene/part_queries.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstring>
#include <random>

#include "tests/refusal.h"
#include "tileflight/world/scene/scene.h"
#include "tileflight/world/scene/test_rays.h"
#include "tileflight/world/scene/test_shapes.h"

namespace tileflight::scene::part_queries_test {
namespace {

using geometry::Vec3;
using imaging::TexturedMesh;
using test_rays::beam_of;
using test_rays::directions_around;
using test_shapes::soup;
using test_shapes::uniform;
using test_shapes::uniform_vector;

using Tiles = std::vector<std::vector<TexturedMesh>>;

/// Holds the same meshes as one tree and as a tree of parts.
struct Both {
  Scene whole, parts;

  explicit Both(const Tiles& tiles, const Vec3& anchor) : whole(all(tiles), anchor), parts(parts_of(tiles, anchor)) {}

 private:
  static std::vector<TexturedMesh> all(const Tiles& tiles) {
    std::vector<TexturedMesh> meshes;
    for (const auto& tile : tiles) meshes.insert(meshes.end(), tile.begin(), tile.end());
    return meshes;
  }
  static std::vector<std::shared_ptr<const ScenePart>> parts_of(const Tiles& tiles, const Vec3& anchor) {
    const SceneFrame frame(anchor);
    std::vector<std::shared_ptr<const ScenePart>> parts;
    for (const auto& tile : tiles) parts.push_back(std::make_shared<const ScenePart>(tile, frame));
    return parts;
  }
};

/// Overlapping tiles of several meshes, one of them empty.
Tiles soups(std::mt19937_64& random, const Vec3& center) {
  Tiles tiles;
  for (int i = 0; i < 40; ++i) {
    const Vec3 at = center + uniform_vector(random, 40.0);
    tiles.push_back({soup(random, 30, at, 10.0), TexturedMesh{}, soup(random, 20, at, 5.0)});
    if (i == 7) tiles.emplace_back();
  }
  return tiles;
}

/// A closed cube, its faces cut into squares of two triangles, as 6 x 4 tiles that meet along their borders only.
Tiles cube() {
  constexpr int kCells = 8;
  Tiles tiles;
  for (int face = 0; face < 6; ++face) {
    for (int quarter = 0; quarter < 4; ++quarter) {
      TexturedMesh mesh;
      for (int j = 0; j <= kCells / 2; ++j) {
        for (int i = 0; i <= kCells / 2; ++i) {
          Vec3 p;
          p[face / 2] = face % 2 == 0 ? -20.0 : 20.0;
          p[(face / 2 + 1) % 3] = -20.0 + 40.0 * (i + quarter % 2 * kCells / 2) / kCells;
          p[(face / 2 + 2) % 3] = -20.0 + 40.0 * (j + quarter / 2 * kCells / 2) / kCells;
          mesh.mesh.vertices.push_back(p);
        }
      }
      constexpr std::uint32_t kRow = kCells / 2 + 1;
      for (std::uint32_t j = 0; j + 1 < kRow; ++j) {
        for (std::uint32_t i = 0; i + 1 < kRow; ++i) {
          const std::uint32_t a = j * kRow + i;
          mesh.mesh.triangles.push_back({a, a + 1, a + kRow});
          mesh.mesh.triangles.push_back({a + 1, a + kRow + 1, a + kRow});
        }
      }
      tiles.push_back({mesh});
    }
  }
  return tiles;
}

template <std::size_t N>
bool same_bits(const float (&a)[N], const float (&b)[N]) {
  return std::memcmp(a, b, sizeof a) == 0;
}

void expect_same_hits(const RayPacket8& a, const RayPacket8& b, const std::string& where) {
  EXPECT_TRUE(std::equal(std::begin(a.mesh), std::end(a.mesh), std::begin(b.mesh))) << where;
  EXPECT_TRUE(std::equal(std::begin(a.triangle), std::end(a.triangle), std::begin(b.triangle))) << where;
  EXPECT_TRUE(same_bits(a.far, b.far)) << where;
  EXPECT_TRUE(same_bits(a.u, b.u) && same_bits(a.v, b.v)) << where;
  EXPECT_TRUE(same_bits(a.normal_x, b.normal_x) && same_bits(a.normal_y, b.normal_y) &&
              same_bits(a.normal_z, b.normal_z))
      << where;
}

/// Beams, packets, occlusion, single rays and nearest surfaces. Returns the number of hits.
int expect_same(const Both& both, const Vec3& origin, const std::array<Vec3, 64>& directions,
                const std::string& where) {
  int hits = 0;
  auto one = beam_of(origin, directions, both.whole.anchor()), other = one;
  auto packet = one[0], other_packet = one[0];
  both.whole.intersect(one);
  both.parts.intersect(other);
  for (std::size_t k = 0; k < 8; ++k) expect_same_hits(one[k], other[k], where + ", beam");
  both.whole.intersect(packet);
  both.parts.intersect(other_packet);
  expect_same_hits(packet, other_packet, where + ", packet");
  auto shadow = beam_of(origin, directions, both.whole.anchor())[0], other_shadow = shadow;
  both.whole.test_occlusion(shadow);
  both.parts.test_occlusion(other_shadow);
  EXPECT_TRUE(same_bits(shadow.far, other_shadow.far)) << where;
  for (std::size_t i = 0; i < 64; i += 5) {
    const Ray ray{origin, directions[i]};
    const auto a = both.whole.intersect(ray, 200.0), b = both.parts.intersect(ray, 200.0);
    EXPECT_EQ(a.has_value(), b.has_value()) << where;
    EXPECT_EQ(both.whole.is_occluded(ray, 20.0), both.parts.is_occluded(ray, 20.0)) << where;
    if (!a || !b) continue;
    ++hits;
    EXPECT_EQ(std::tie(a->distance_m, a->mesh, a->triangle, a->u, a->v),
              std::tie(b->distance_m, b->mesh, b->triangle, b->u, b->v))
        << where;
  }
  EXPECT_EQ(both.whole.distance_to_surface_m(origin, 5.0), both.parts.distance_to_surface_m(origin, 5.0)) << where;
  EXPECT_EQ(both.whole.distance_to_surface_m(origin, 1e3), both.parts.distance_to_surface_m(origin, 1e3)) << where;
  return hits;
}

class Parts : public testing::TestWithParam<Vec3> {};

TEST_P(Parts, OfRandomTrianglesAnswerAsTheWhole) {
  const Vec3 center = GetParam();
  std::mt19937_64 random(11);
  const Both both(soups(random, center), center + Vec3(3, 4, 5));
  EXPECT_EQ(both.parts.meshes().size(), both.whole.meshes().size());
  EXPECT_EQ(both.parts.triangle_count(), both.whole.triangle_count());
  EXPECT_EQ(both.parts.bounds().min(), both.whole.bounds().min());
  int hits = 0;
  for (int round = 0; round < 300; ++round) {
    const double step = round % 3 == 0 ? 0.3 : 0.01;
    hits += expect_same(both, center + uniform_vector(random, 60.0),
                        directions_around(uniform_vector(random, 1.0), step), "round " + std::to_string(round));
  }
  EXPECT_GT(hits, 300);
}

INSTANTIATE_TEST_SUITE_P(At, Parts, testing::Values(Vec3(0, 0, 0), Vec3(4127.3, -3713.1, 2900.7)));

TEST(PartsAtEdges, ThroughBordersOfTilesNoRayLeavesAClosedCube) {
  const Both both(cube(), Vec3::Zero());
  std::mt19937_64 random(12);
  for (int round = 0; round < 300; ++round) {
    // Along the borders of tiles and the edges of the cube; near enough together to be one beam.
    const Vec3 origin = uniform_vector(random, 10.0);
    const double middle = uniform(random, -17.0, 17.0);
    std::array<Vec3, 64> directions;
    const int axis = round % 3;
    for (std::size_t i = 0; i < 64; ++i) {
      Vec3 target;
      target[axis] = 20.0;
      target[(axis + 1) % 3] = round % 2 == 0 ? 0.0 : 20.0;
      target[(axis + 2) % 3] = middle + uniform(random, -3.0, 3.0);
      directions[i] = (target - origin).normalized();
    }
    auto beam = beam_of(origin, directions, Vec3::Zero()), other = beam;
    both.whole.intersect(beam);
    both.parts.intersect(other);
    for (std::size_t k = 0; k < 8; ++k) {
      expect_same_hits(beam[k], other[k], "round " + std::to_string(round));
      EXPECT_EQ(std::count(std::begin(other[k].mesh), std::end(other[k].mesh), RayPacket8::kMiss), 0);
    }
    for (const Vec3& direction : directions) {
      const auto a = both.whole.intersect({origin, direction}), b = both.parts.intersect({origin, direction});
      ASSERT_TRUE(a && b);
      // Where two triangles meet, either may be named.
      EXPECT_NEAR(a->distance_m, b->distance_m, 1e-5);
      EXPECT_TRUE(both.parts.is_occluded({origin, direction}, 60.0));
    }
  }
}

TEST(PartsAtEdges, OfEqualSurfacesTheFirstIsMet) {
  const TexturedMesh field = test_shapes::height_field(20, 50.0, Vec3::Zero(), [](double, double) { return 0.0; });
  const Both both({{field, field}, {}, {field}, {field, field}}, Vec3::Zero());
  std::mt19937_64 random(13);
  for (int round = 0; round < 100; ++round) {
    const Vec3 origin = uniform_vector(random, 20.0) + Vec3(0, 0, 30.0);
    auto beam = beam_of(origin, directions_around(Vec3(0, 0, -1), 0.02), Vec3::Zero()), other = beam;
    both.whole.intersect(beam);
    both.parts.intersect(other);
    for (std::size_t k = 0; k < 8; ++k) expect_same_hits(beam[k], other[k], "round " + std::to_string(round));
    EXPECT_EQ(other[0].mesh[0], 0U);
    const auto a = both.whole.intersect({origin, -Vec3::UnitZ()}), b = both.parts.intersect({origin, -Vec3::UnitZ()});
    ASSERT_TRUE(a && b);
    EXPECT_EQ(a->distance_m, b->distance_m);
    EXPECT_LT(b->mesh, 2U) << "of the first part";
  }
}

TEST(PartsOfAScene, AreSharedAndMayOutliveIt) {
  const SceneFrame frame{Vec3(Vec3::Zero())};
  const TexturedMesh field = test_shapes::height_field(4, 20.0, Vec3::Zero(), [](double, double) { return 0.0; });
  const auto part = std::make_shared<const ScenePart>(std::vector{field}, frame);
  const BeamTree* tree = nullptr;
  {
    const Scene gone({part, std::make_shared<const ScenePart>(std::vector{field}, frame)});
    gone.build_beam_tree();
    tree = &part->beam_tree();
  }
  const Scene scene({std::make_shared<const ScenePart>(std::vector<TexturedMesh>(), frame), part});
  scene.build_beam_tree();
  EXPECT_EQ(&part->beam_tree(), tree) << "not built again";
  EXPECT_EQ(&scene.meshes()[0], &part->meshes()[0]);
  const auto hit = scene.intersect({Vec3(1, 2, 9), -Vec3::UnitZ()});
  ASSERT_TRUE(hit);
  EXPECT_NEAR(hit->distance_m, 9.0, 1e-6);
  EXPECT_THAT(
      tests::refusal_of([&] { Scene({std::make_shared<const ScenePart>(std::vector<TexturedMesh>(), frame)}); }),
      testing::HasSubstr("scene: contains no triangle"));
}

}  // namespace
}  // namespace tileflight::scene::part_queries_test
