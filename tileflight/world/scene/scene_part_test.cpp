// A scene with placed parts against the scene of one tree over the same meshes, moved to their places.
#include "tileflight/world/scene/scene_part.h"

#include <gmock/gmock.h>

#include <array>
#include <cmath>
#include <random>

#include "tests/refusal.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/world/scene/beam_tree.h"
#include "tileflight/world/scene/scene.h"
#include "tileflight/world/scene/test_rays.h"
#include "tileflight/world/scene/test_shapes.h"

namespace tileflight::scene::placed_part_test {
namespace {

using geometry::SE3;
using geometry::Vec3;
using imaging::TexturedMesh;
using test_rays::beam_of;
using test_rays::directions_around;
using test_shapes::soup;
using test_shapes::uniform;
using test_shapes::uniform_vector;

using Meshes = std::vector<TexturedMesh>;

Eigen::Affine3d any_pose(std::mt19937_64& random, const Vec3& around) {
  const SE3 pose(geometry::so3_exp(uniform_vector(random, 2.0)), around + uniform_vector(random, 30.0));
  return placed_at(pose, {uniform(random, 0.3, 3.0), uniform(random, 0.3, 3.0), uniform(random, 0.3, 3.0)});
}

Eigen::Affine3d small_change(std::mt19937_64& random) {
  return placed_at(SE3(geometry::so3_exp(uniform_vector(random, 0.4)), uniform_vector(random, 3.0)),
                   {uniform(random, 0.8, 1.2), uniform(random, 0.8, 1.2), uniform(random, 0.8, 1.2)});
}

/// The pose at a time, points moving on straight lines.
Eigen::Affine3d pose_at(const std::vector<Eigen::Affine3d>& poses, double time) {
  if (poses.size() == 1) return poses[0];
  const double at = time * static_cast<double>(poses.size() - 1);
  const auto step = std::min(static_cast<std::size_t>(at), poses.size() - 2);
  const double share = at - static_cast<double>(step);
  Eigen::Affine3d between = poses[step];
  between.matrix() = (1.0 - share) * poses[step].matrix() + share * poses[step + 1].matrix();
  return between;
}

struct World {
  Meshes place;
  std::vector<std::shared_ptr<const ScenePart>> models;
  std::vector<PlacedPart> placed;
  Vec3 anchor;

  /// `poses`: of each placed part.
  World(std::mt19937_64& random, const Vec3& center, std::size_t poses) : anchor(center + Vec3(3, 4, 5)) {
    place = {soup(random, 200, center, 60.0), TexturedMesh{}, soup(random, 50, center, 20.0)};
    const SceneFrame own(Vec3(0.5, -0.25, 2.0));
    for (int i = 0; i < 3; ++i) {
      models.push_back(std::make_shared<const ScenePart>(
          Meshes{soup(random, 120, Vec3::Zero(), 9.0), soup(random, 60, Vec3(1, 1, 1), 7.0)}, own));
    }
    models.push_back(std::make_shared<const ScenePart>(Meshes{}, own));
    for (std::size_t i = 0; i < 12; ++i) {
      PlacedPart one{"thing" + std::to_string(i), models[i % 4], {}};
      one.poses.push_back(any_pose(random, center));
      for (std::size_t k = 1; k < poses; ++k) one.poses.push_back(one.poses.back() * small_change(random));
      placed.push_back(std::move(one));
    }
  }
  Scene scene() const { return Scene({std::make_shared<const ScenePart>(place, SceneFrame(anchor))}, placed); }
  Scene baked(double time) const {
    Meshes all = place;
    for (const PlacedPart& one : placed) {
      for (TexturedMesh mesh : one.part->meshes()) {
        for (Vec3& vertex : mesh.mesh.vertices) vertex = pose_at(one.poses, time) * vertex;
        all.push_back(std::move(mesh));
      }
    }
    return Scene(std::move(all), anchor);
  }
};

/// Number of answers that differ; answers of rays that graze an edge may differ within rounding.
struct Count {
  int hits = 0, placed = 0, different = 0;

  void compare(const RayPacket8& a, const RayPacket8& b, std::size_t i, std::uint32_t first_placed) {
    const bool hit = a.mesh[i] != RayPacket8::kMiss;
    hits += hit ? 1 : 0;
    placed += hit && a.mesh[i] >= first_placed ? 1 : 0;
    if (a.mesh[i] != b.mesh[i] || a.triangle[i] != b.triangle[i]) {
      ++different;
      return;
    }
    if (!hit) return;
    EXPECT_NEAR(a.far[i], b.far[i], 2e-4 + 1e-5 * a.far[i]);
    EXPECT_NEAR(a.u[i], b.u[i], 0.02);
    EXPECT_NEAR(a.v[i], b.v[i], 0.02);
    const Eigen::Vector3f n(a.normal_x[i], a.normal_y[i], a.normal_z[i]);
    const Eigen::Vector3f m(b.normal_x[i], b.normal_y[i], b.normal_z[i]);
    EXPECT_LT((n - m).norm(), 1e-3F * n.norm() + 1e-4F) << "oriented, and as long";
  }
};

class Placed : public testing::TestWithParam<Vec3> {};

TEST_P(Placed, PartsAnswerAsTheirMeshesMovedThere) {
  std::mt19937_64 random(31);
  const World world(random, GetParam(), 1);
  const Scene scene = world.scene(), baked = world.baked(0.0);
  ASSERT_EQ(scene.meshes().size(), baked.meshes().size());
  EXPECT_EQ(scene.first_placed_mesh(), 3U);
  EXPECT_EQ(scene.triangle_count(), baked.triangle_count());
  EXPECT_TRUE(scene.bounds().contains(baked.bounds()));
  Count beams, packets;
  int rays = 0, rays_different = 0;
  for (int round = 0; round < 900; ++round) {
    const Vec3 origin = GetParam() + uniform_vector(random, 50.0);
    const auto directions = directions_around(uniform_vector(random, 1.0), round % 3 == 0 ? 0.1 : 0.01);
    auto one = beam_of(origin, directions, world.anchor, 0.0), other = one;
    auto packet = one[0], other_packet = one[0], shadow = one[1], other_shadow = one[1];
    baked.intersect(one);
    scene.intersect(other);
    for (std::size_t k = 0; k < 64; ++k) beams.compare(one[k / 8], other[k / 8], k % 8, 3);
    baked.intersect(packet);
    scene.intersect(other_packet);
    for (std::size_t k = 0; k < 8; ++k) packets.compare(packet, other_packet, k, 3);
    baked.test_occlusion(shadow);
    scene.test_occlusion(other_shadow);
    for (std::size_t k = 0; k < 8; ++k) packets.different += (shadow.far[k] < 0) != (other_shadow.far[k] < 0) ? 1 : 0;
    for (std::size_t i = 0; i < 64; i += 9) {
      const Ray ray{origin, directions[i]};
      const auto a = baked.intersect(ray, 200.0), b = scene.intersect(ray, 200.0);
      ++rays;
      rays_different += baked.is_occluded(ray, 20.0) != scene.is_occluded(ray, 20.0) ? 1 : 0;
      if (a.has_value() != b.has_value() || (a && (a->mesh != b->mesh || a->triangle != b->triangle))) {
        ++rays_different;
        continue;
      }
      if (!a) continue;
      EXPECT_NEAR(a->distance_m, b->distance_m, 1e-6 * a->distance_m + 1e-9) << "from planes in double precision";
      EXPECT_LT((baked.normal(*a) - scene.normal(*b)).norm(), 1e-6);
      EXPECT_LT((scene.position(*b) - origin - b->distance_m * ray.direction).norm(), 1e-2);
    }
  }
  EXPECT_GT(beams.placed, 5000);
  EXPECT_GT(packets.placed, 600);
  EXPECT_LE(beams.different, beams.hits / 1000);
  EXPECT_LE(packets.different, 6);
  EXPECT_LE(rays_different, rays / 500);
}

TEST_P(Placed, PartsAreAsFarAsTheirMeshes) {
  std::mt19937_64 random(32);
  const World world(random, GetParam(), 2);
  const Scene scene = world.scene();
  for (const double time : {0.0, 0.35, 1.0}) {
    const Scene baked = world.baked(time);
    for (int round = 0; round < 100; ++round) {
      const Vec3 point = GetParam() + uniform_vector(random, 50.0);
      for (const double within_m : {2.0, 1e3}) {
        const auto a = baked.distance_to_surface_m(point, within_m);
        const auto b = scene.distance_to_surface_m(point, within_m, time);
        ASSERT_EQ(a.has_value(), b.has_value());
        EXPECT_NEAR(a.value_or(0.0), b.value_or(0.0), 1e-9 * (1.0 + GetParam().norm()));
      }
    }
  }
}

TEST_P(Placed, PartsThatMoveAreMetWhereTheyAreAtEachRaysTime) {
  std::mt19937_64 random(33);
  const World world(random, GetParam(), 3);
  const Scene scene = world.scene();
  for (const double time : {0.0, 0.2, 0.5, 0.9}) {
    const Scene baked = world.baked(time);
    Count beams, packets;
    for (int round = 0; round < 300; ++round) {
      const Vec3 origin = GetParam() + uniform_vector(random, 50.0);
      const auto directions = directions_around(uniform_vector(random, 1.0), 0.02);
      auto one = beam_of(origin, directions, world.anchor, time), other = one;
      // Lanes of a packet each have their own time.
      auto packet = one[0], mixed = one[0];
      for (std::size_t k = 1; k < 8; k += 2) mixed.time[k] = 1.0F - mixed.time[k];
      baked.intersect(one);
      scene.intersect(other);
      for (std::size_t k = 0; k < 64; ++k) beams.compare(one[k / 8], other[k / 8], k % 8, 3);
      baked.intersect(packet);
      scene.intersect(mixed);
      for (std::size_t k = 0; k < 8; k += 2) packets.compare(packet, mixed, k, 3);
      const auto a = baked.intersect({origin, directions[5]}), b = scene.intersect({origin, directions[5], time});
      if (a && b && a->mesh == b->mesh) {
        EXPECT_NEAR(a->distance_m, b->distance_m, 1e-5);
      }
    }
    EXPECT_GT(beams.placed, 900);
    EXPECT_LE(beams.different, beams.hits / 500);
    EXPECT_LE(packets.different, 3);
  }
}

INSTANTIATE_TEST_SUITE_P(At, Placed, testing::Values(Vec3(0, 0, 0), Vec3(1127.3, -713.1, 900.7)));

TEST(PlacedPart, MovingOneBuildsNoTreeAgain) {
  std::mt19937_64 random(34);
  World world(random, Vec3::Zero(), 1);
  const auto place = std::make_shared<const ScenePart>(world.place, SceneFrame(world.anchor));
  const Scene before({place}, world.placed);
  before.build_beam_tree();
  before.build_ray_tree();
  const auto trees = [&] {
    std::vector<const void*> all{&place->beam_tree(), &place->ray_tree()};
    for (std::size_t i = 0; i < 3; ++i)
      all.insert(all.end(), {&world.models[i]->beam_tree(), &world.models[i]->ray_tree()});
    return all;
  };
  const std::vector<const void*> built = trees();
  world.placed[0].poses = {any_pose(random, Vec3::Zero())};
  const Scene after({place}, world.placed);
  after.build_beam_tree();
  EXPECT_EQ(trees(), built);
  EXPECT_EQ(after.placed_pose(0, 0.5).matrix(), world.placed[0].poses[0].matrix());
  EXPECT_EQ(after.placed_of_mesh(3), 0U);
  EXPECT_EQ(after.placed_of_mesh(5), 1U) << "each has two meshes";
}

TEST(PlacedPart, PosesThatMirrorOrFlattenAreRefused) {
  std::mt19937_64 random(35);
  World world(random, Vec3::Zero(), 1);
  const auto refusal = [&](const Eigen::Affine3d& pose) {
    world.placed[4].poses = {pose};
    try {
      world.scene();
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_THAT(refusal(placed_at({}, {1, 1, -1})), testing::HasSubstr("thing4: its pose mirrors"));
  EXPECT_THAT(refusal(placed_at({}, {1, 0, 1})), testing::HasSubstr("flat"));
  EXPECT_THAT(refusal(placed_at({}, {1, NAN, 1})), testing::HasSubstr("finite"));
  world.placed[4].poses = {placed_at({}), placed_at(SE3(geometry::so3_exp(Vec3(0, 0, 1.6)), Vec3(0, 0, 0)))};
  EXPECT_THAT(tests::refusal_of([&] { world.scene(); }), testing::HasSubstr("thing4: turns by a right angle or more"));
  world.placed[4].poses.clear();
  EXPECT_THAT(tests::refusal_of([&] { world.scene(); }), testing::HasSubstr("thing4: has no pose"));
}

}  // namespace
}  // namespace tileflight::scene::placed_part_test
