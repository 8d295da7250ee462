// Tests rays that start from different places, traversed at once, against single rays through the same scene, and
// against beams of one origin.
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <array>
#include <cmath>
#include <cstring>
#include <random>
#include <vector>

#include "tileflight/world/scene/beam_tree.h"
#include "tileflight/world/scene/packets.h"
#include "tileflight/world/scene/scene.h"
#include "tileflight/world/scene/test_rays.h"
#include "tileflight/world/scene/test_shapes.h"

namespace tileflight::scene::moving_beam_test {
namespace {

using geometry::SE3;
using geometry::Vec3;
using imaging::TexturedMesh;
using test_rays::beam_of;
using test_rays::directions_around;
using test_shapes::soup;
using test_shapes::uniform;
using test_shapes::uniform_vector;

using Packets = std::array<RayPacket8, 8>;

TexturedMesh ground(int cells, double size_m, const Vec3& center) {
  return test_shapes::height_field(cells, size_m, center,
                                   [](double x, double y) { return 3.0 * std::sin(0.3 * x) * std::cos(0.2 * y); });
}

/// The rays of a moving camera: 8 x 8 directions at each of `moments`, each row with a pose and time of its own.
struct MovingRays {
  std::vector<std::array<Ray, 64>> rays;  ///< [moment][ray], row by row
  std::vector<Packets> packets;           ///< the same: a packet is a row

  /// In `span` of the way of the whole exposure, the camera moves by `travel` and turns by `turn` (rad).
  MovingRays(const Vec3& origin, const std::array<Vec3, 64>& directions, const Vec3& travel, const Vec3& turn,
             std::size_t moments, const Vec3& anchor)
      : rays(moments), packets(moments) {
    for (std::size_t k = 0; k < moments; ++k) {
      for (std::size_t i = 0; i < 64; ++i) {
        const double time = (static_cast<double>(k) + static_cast<double>(i / 8) / 8.0) / static_cast<double>(moments);
        const Eigen::Quaterniond rotation = geometry::so3_exp(time * turn);
        rays[k][i] = {origin + time * travel, rotation * directions[i], time};
        const auto row = beam_of(rays[k][i].origin, directions, anchor, time)[i / 8];
        RayPacket8& packet = packets[k][i / 8];
        if (i % 8 == 0) packet = row;
        const Eigen::Vector3f d = rays[k][i].direction.cast<float>();
        packet.direction_x[i % 8] = d.x();
        packet.direction_y[i % 8] = d.y();
        packet.direction_z[i % 8] = d.z();
      }
    }
  }
  std::vector<std::span<RayPacket8>> beams() {
    std::vector<std::span<RayPacket8>> all;
    for (Packets& one : packets) all.emplace_back(one);
    return all;
  }
};

/// Number of answers that differ; answers of rays that graze an edge may differ within rounding.
struct Count {
  int hits = 0, placed = 0, different = 0;

  void compare(const Scene& scene, const MovingRays& moving) {
    for (std::size_t k = 0; k < moving.rays.size(); ++k) {
      for (std::size_t i = 0; i < 64; ++i) compare(scene, moving.rays[k][i], moving.packets[k][i / 8], i % 8);
    }
  }
  void compare(const Scene& scene, const Ray& ray, const RayPacket8& packet, std::size_t lane) {
    const auto hit = scene.intersect(ray);
    hits += hit ? 1 : 0;
    if (hit.has_value() != (packet.mesh[lane] != RayPacket8::kMiss) ||
        (hit && (hit->mesh != packet.mesh[lane] || hit->triangle != packet.triangle[lane]))) {
      ++different;
      return;
    }
    if (!hit) return;
    placed += hit->mesh >= scene.first_placed_mesh() ? 1 : 0;
    const Vec3 normal(packet.normal_x[lane], packet.normal_y[lane], packet.normal_z[lane]);
    const double slope = std::abs(normal.normalized().dot(ray.direction));
    EXPECT_LT((normal.normalized() - scene.normal(*hit)).norm(), 1e-3);
    if (slope < 0.01) return;  // uncertain where a surface is seen at half a degree
    EXPECT_NEAR(packet.far[lane], hit->distance_m, 2e-4 * (1.0 + hit->distance_m));
    EXPECT_NEAR(packet.u[lane], hit->u, 0.02);
    EXPECT_NEAR(packet.v[lane], hit->v, 0.02);
  }
};

struct Case {
  const char* name;
  Vec3 center;
  double step;    ///< from ray to ray
  double travel;  ///< of the camera, metres
  double turn;    ///< rad
  std::size_t moments;
};

class Moving : public testing::TestWithParam<Case> {};

TEST_P(Moving, RaysHitWhatSingleRaysHit) {
  const Case& of = GetParam();
  std::mt19937_64 random(21);
  const Scene scene({ground(90, 120.0, of.center), soup(random, 3000, of.center, 30.0)});
  Count count;
  for (int round = 0; round < 200; ++round) {
    const Vec3 origin = of.center + uniform_vector(random, 30.0) + Vec3(0, 0, 34.0);
    const Vec3 forward = uniform_vector(random, 1.0) - Vec3(0, 0, 0.7);
    MovingRays moving(origin, directions_around(forward, of.step), uniform_vector(random, of.travel),
                      uniform_vector(random, of.turn), of.moments, scene.anchor());
    scene.intersect_moving(moving.beams());
    count.compare(scene, moving);
  }
  EXPECT_GT(count.hits, 5000);
  EXPECT_LE(count.different, count.hits / 1000);
}

INSTANTIATE_TEST_SUITE_P(By, Moving,
                         testing::Values(Case{"a_row", Vec3::Zero(), 0.001, 0.001, 1e-4, 1},
                                         Case{"an_exposure", Vec3::Zero(), 0.001, 0.06, 0.005, 3},
                                         Case{"an_exposure_far_up", {412.7, -371.3, 2900.1}, 0.001, 0.06, 0.005, 4},
                                         Case{"metres", Vec3::Zero(), 0.01, 5.0, 0.3, 4},
                                         Case{"wide_pixels", {12.7, -71.3, 900.1}, 0.3, 0.5, 0.1, 2},
                                         Case{"too_wide_to_be_one", Vec3::Zero(), 0.6, 0.5, 0.1, 2}),
                         [](const auto& test) { return std::string(test.param.name); });

TEST(MovingAtRest, BeamsAreThoseOfOneOriginToTheLastBit) {
  std::mt19937_64 random(22);
  const Scene scene({ground(90, 120.0, Vec3::Zero()), soup(random, 3000, Vec3::Zero(), 30.0)});
  for (int round = 0; round < 300; ++round) {
    const Vec3 origin = uniform_vector(random, 30.0) + Vec3(0, 0, 34.0);
    const auto directions = directions_around(uniform_vector(random, 1.0) - Vec3(0, 0, 0.7), 0.005);
    Packets one = beam_of(origin, directions, scene.anchor());
    for (RayPacket8& packet : one) {
      if (random() % 3 == 0) packet.disable_lane(static_cast<int>(random() % 8));
    }
    Packets other = one;
    scene.intersect(one);
    const std::span<RayPacket8> beam(other);
    scene.intersect_moving(std::span(&beam, 1));
    ASSERT_EQ(std::memcmp(one.data(), other.data(), sizeof(one)), 0) << round;
  }
}

TEST(MovingBeams, MeetPlacedPartsWhereTheyAreAtEachRaysTime) {
  std::mt19937_64 random(23);
  const SceneFrame own(Vec3(0.5, -0.25, 2.0));
  const auto model = std::make_shared<const ScenePart>(
      std::vector<TexturedMesh>{soup(random, 120, Vec3::Zero(), 9.0), soup(random, 60, Vec3(1, 1, 1), 7.0)}, own);
  std::vector<PlacedPart> placed;
  for (int i = 0; i < 12; ++i) {
    const SE3 pose(geometry::so3_exp(uniform_vector(random, 2.0)), uniform_vector(random, 30.0));
    PlacedPart one{"thing", model, {placed_at(pose, {1.3, 0.6, 1.0})}};
    if (i % 2 == 0) {
      one.poses.push_back(one.poses[0] *
                          placed_at(SE3(geometry::so3_exp(uniform_vector(random, 0.3)), uniform_vector(random, 2.0))));
    }
    placed.push_back(std::move(one));
  }
  const auto place = std::make_shared<const ScenePart>(std::vector<TexturedMesh>{soup(random, 200, Vec3::Zero(), 60.0)},
                                                       SceneFrame(Vec3(3, 4, 5)));
  const Scene scene({place}, placed);
  Count count;
  for (int round = 0; round < 300; ++round) {
    MovingRays moving(uniform_vector(random, 50.0), directions_around(uniform_vector(random, 1.0), 0.01),
                      uniform_vector(random, 0.2), uniform_vector(random, 0.02), 1 + round % 4, scene.anchor());
    scene.intersect_moving(moving.beams());
    count.compare(scene, moving);
  }
  EXPECT_GT(count.placed, 2000);
  EXPECT_LE(count.different, count.hits / 500);
}

TEST(MovingBeams, NoneLeaksThroughTheEdgesOfASurface) {
  const TexturedMesh plane = ground(30, 60.0, Vec3::Zero());
  const Scene scene({plane}, Vec3::Zero());
  std::mt19937_64 random(24);
  for (int round = 0; round < 2000; ++round) {
    const auto& triangle = plane.mesh.triangles[random() % plane.mesh.triangles.size()];
    const Vec3 a = plane.mesh.vertices[triangle[0]], b = plane.mesh.vertices[triangle[1]];
    if (std::max(a.head<2>().cwiseAbs().maxCoeff(), b.head<2>().cwiseAbs().maxCoeff()) > 29.0) continue;
    const Vec3 origin = 0.5 * (a + b) + Vec3(uniform(random, -5.0, 5.0), uniform(random, -5.0, 5.0), 20.0);
    MovingRays moving(origin, directions_around(a - origin, 1e-3), uniform_vector(random, 0.1), Vec3::Zero(), 2,
                      scene.anchor());
    for (std::size_t k = 0; k < 2; ++k) {
      for (std::size_t i = 0; i < 64; ++i) {  // all along the edge
        const Eigen::Vector3f d =
            (a + (static_cast<double>(i) + 0.5) / 64.0 * (b - a) - moving.rays[k][i].origin).normalized().cast<float>();
        RayPacket8& packet = moving.packets[k][i / 8];
        packet.direction_x[i % 8] = d.x();
        packet.direction_y[i % 8] = d.y();
        packet.direction_z[i % 8] = d.z();
      }
    }
    scene.intersect_moving(moving.beams());
    for (const Packets& packets : moving.packets) {
      for (std::size_t i = 0; i < 64; ++i) ASSERT_NE(packets[i / 8].mesh[i % 8], RayPacket8::kMiss) << round;
    }
  }
}

TEST(MovingBeams, DoNotDependOnTheThreadsThatBuiltTheTree) {
  std::mt19937_64 shapes(25);
  const std::vector<TexturedMesh> meshes{ground(90, 120.0, Vec3::Zero()), soup(shapes, 3000, Vec3::Zero(), 30.0)};
  const auto answers = [&](std::size_t threads) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    const Scene scene(meshes);
    std::mt19937_64 random(26);
    std::vector<std::pair<std::uint32_t, float>> all;
    for (int round = 0; round < 50; ++round) {
      MovingRays moving(uniform_vector(random, 30.0) + Vec3(0, 0, 34.0), directions_around(Vec3(0.1, 0.2, -1), 0.002),
                        uniform_vector(random, 0.1), uniform_vector(random, 0.01), 3, scene.anchor());
      scene.intersect_moving(moving.beams());
      for (const Packets& packets : moving.packets) {
        for (std::size_t i = 0; i < 64; ++i)
          all.emplace_back(packets[i / 8].triangle[i % 8], packets[i / 8].far[i % 8]);
      }
    }
    return all;
  };
  const auto reference = answers(1);
  EXPECT_EQ(answers(2), reference);
  EXPECT_EQ(answers(3), reference);
}

}  // namespace
}  // namespace tileflight::scene::moving_beam_test
