// Tests beams against Embree's packets, against brute force in double precision, and by invariants of any ray tracer.
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <random>

#include "tileflight/world/scene/packets.h"
#include "tileflight/world/scene/scene.h"
#include "tileflight/world/scene/test_shapes.h"

namespace tileflight::scene::beam_traversal_test {
namespace {

using geometry::Vec3;
using imaging::TexturedMesh;
using test_shapes::soup;
using test_shapes::uniform;
using test_shapes::uniform_vector;

constexpr int kSide = 8;  // rays

/// 8 x 8 rays from one point, as packets of 4 x 2.
struct Beam {
  Vec3 origin;
  std::array<Vec3, 64> directions;  ///< row by row, unit
  std::array<RayPacket8, 8> packets;

  static int packet_of(int x, int y) { return y / 2 * 2 + x / 4; }
  static int lane_of(int x, int y) { return y % 2 * 4 + x % 4; }

  /// Rays around `forward` (any length); neighbouring rays are `step` apart at distance 1.
  Beam(const Vec3& from, const Vec3& forward, double step, const Vec3& anchor) : origin(from) {
    const Vec3 z = forward.normalized();
    const Vec3 x = z.unitOrthogonal(), y = z.cross(x);
    for (int j = 0; j < kSide; ++j) {
      for (int i = 0; i < kSide; ++i) {
        directions[8 * j + i] = (z + step * (i - 3.5) * x + step * (j - 3.5) * y).normalized();
      }
    }
    write(anchor);
  }
  void write(const Vec3& anchor) {
    for (RayPacket8& packet : packets) packet.reset();
    for (int j = 0; j < kSide; ++j) {
      for (int i = 0; i < kSide; ++i) {
        RayPacket8& packet = packets[packet_of(i, j)];
        const int lane = lane_of(i, j);
        const Eigen::Vector3f o = (origin - anchor).cast<float>(), d = directions[8 * j + i].cast<float>();
        packet.origin_x[lane] = o.x();
        packet.origin_y[lane] = o.y();
        packet.origin_z[lane] = o.z();
        packet.direction_x[lane] = d.x();
        packet.direction_y[lane] = d.y();
        packet.direction_z[lane] = d.z();
      }
    }
  }
  const RayPacket8& packet(int ray) const { return packets[packet_of(ray % 8, ray / 8)]; }
  static int lane(int ray) { return lane_of(ray % 8, ray / 8); }
};

/// Rolling ground of shared vertices.
TexturedMesh ground(int cells, double size_m, const Vec3& center) {
  return test_shapes::height_field(cells, size_m, center,
                                   [](double x, double y) { return 3.0 * std::sin(0.3 * x) * std::cos(0.2 * y); });
}

struct Met {
  double distance_m = std::numeric_limits<double>::infinity();
  std::uint32_t mesh = 0, triangle = 0;
  double u = 0.0, v = 0.0;
  Vec3 normal = Vec3::Zero();
  bool clear = true;  ///< no other hit nearly as near, and no edge nearby: float rounding cannot change the result
};

/// Moeller and Trumbore 1997, against every triangle.
Met brute_force(const std::vector<TexturedMesh>& meshes, const Vec3& origin, const Vec3& direction) {
  Met nearest;
  double second_m = std::numeric_limits<double>::infinity();
  bool grazes = false;
  for (std::uint32_t m = 0; m < meshes.size(); ++m) {
    for (std::uint32_t t = 0; t < meshes[m].mesh.triangles.size(); ++t) {
      const auto& corners = meshes[m].mesh.triangles[t];
      const Vec3 a = meshes[m].mesh.vertices[corners[0]];
      const Vec3 e1 = meshes[m].mesh.vertices[corners[1]] - a, e2 = meshes[m].mesh.vertices[corners[2]] - a;
      const Vec3 p = direction.cross(e2), s = origin - a, q = s.cross(e1);
      const double determinant = e1.dot(p);
      const double u = s.dot(p) / determinant, v = direction.dot(q) / determinant, distance = e2.dot(q) / determinant;
      const double margin = std::min({u, v, 1.0 - u - v});
      const double slope = std::abs(e1.cross(e2).normalized().dot(direction));
      if (!(distance > 0.0) || margin < -1e-2) continue;
      if (std::abs(margin) < 1e-2 || slope < 1e-2) {
        grazes = grazes || distance < nearest.distance_m + 0.1;
        if (margin < 0.0 || slope < 1e-2) continue;
      }
      second_m = std::min(second_m, std::max(distance, nearest.distance_m));
      if (distance < nearest.distance_m) nearest = {distance, m, t, u, v, e1.cross(e2), true};
    }
  }
  nearest.clear = !grazes && (std::isinf(nearest.distance_m) || second_m > nearest.distance_m + 1e-2);
  return nearest;
}

void expect_hit(const Met& met, const RayPacket8& packet, int lane, const Vec3& direction) {
  ASSERT_EQ(packet.mesh[lane], met.mesh);
  EXPECT_EQ(packet.triangle[lane], met.triangle);
  EXPECT_NEAR(packet.far[lane], met.distance_m, 2e-5 * (1.0 + met.distance_m));
  EXPECT_NEAR(packet.u[lane], met.u, 2e-3);
  EXPECT_NEAR(packet.v[lane], met.v, 2e-3);
  const Vec3 normal(packet.normal_x[lane], packet.normal_y[lane], packet.normal_z[lane]);
  EXPECT_LT((normal.normalized() - met.normal.normalized()).norm(), 1e-3);
  EXPECT_EQ(normal.dot(direction) > 0.0, met.normal.dot(direction) > 0.0);
}

/// Whether a ray hits its surface at less than half a degree: depths are uncertain there.
bool grazes(const RayPacket8& packet, int i) {
  const Vec3 normal(packet.normal_x[i], packet.normal_y[i], packet.normal_z[i]);
  const Vec3 direction(packet.direction_x[i], packet.direction_y[i], packet.direction_z[i]);
  return std::abs(normal.normalized().dot(direction)) < 0.01;
}

struct Case {
  const char* name;
  Vec3 center;
  double step;  ///< from ray to ray
};

class Beams : public testing::TestWithParam<Case> {};

TEST_P(Beams, AgreeWithEveryTriangleTestedInDouble) {
  const Vec3 center = GetParam().center;
  std::mt19937_64 random(7);
  const std::vector<TexturedMesh> meshes{soup(random, 60, center, 40.0), soup(random, 1, center, 40.0),
                                         soup(random, 60, center, 40.0)};
  const Scene scene(meshes);
  int hits = 0, misses = 0, compared = 0;
  for (int round = 0; round < 200; ++round) {
    Beam beam(center + uniform_vector(random, 60.0), uniform_vector(random, 1.0), GetParam().step, scene.anchor());
    scene.intersect(beam.packets);
    for (int ray = 0; ray < 64; ++ray) {
      const Met met = brute_force(meshes, beam.origin, beam.directions[ray]);
      if (!met.clear) continue;
      ++compared;
      const RayPacket8& packet = beam.packet(ray);
      const bool hit = packet.mesh[Beam::lane(ray)] != RayPacket8::kMiss;
      ASSERT_EQ(hit, std::isfinite(met.distance_m)) << "round " << round << " ray " << ray;
      (hit ? hits : misses)++;
      if (hit) expect_hit(met, packet, Beam::lane(ray), beam.directions[ray]);
      if (!hit) {
        EXPECT_TRUE(std::isinf(packet.far[Beam::lane(ray)]));
      }
    }
  }
  EXPECT_GT(hits, 800);
  EXPECT_GT(misses, 50);
  EXPECT_GT(compared, 2000);
}

TEST_P(Beams, AgreeWithPackets) {
  const Vec3 center = GetParam().center;
  std::mt19937_64 random(8);
  const Scene scene({ground(90, 120.0, center), soup(random, 3000, center, 30.0)});
  int same = 0, other = 0;
  for (int round = 0; round < 300; ++round) {
    Beam beam(center + uniform_vector(random, 30.0) + Vec3(0, 0, 34.0), uniform_vector(random, 1.0) - Vec3(0, 0, 0.7),
              GetParam().step, scene.anchor());
    auto packets = beam.packets;
    scene.intersect(beam.packets);
    for (std::size_t k = 0; k < packets.size(); ++k) {
      scene.intersect(packets[k]);
      for (int i = 0; i < 8; ++i) {
        if (packets[k].mesh[i] == RayPacket8::kMiss && beam.packets[k].mesh[i] == RayPacket8::kMiss) continue;
        const bool equal =
            packets[k].mesh[i] == beam.packets[k].mesh[i] && packets[k].triangle[i] == beam.packets[k].triangle[i];
        (equal ? same : other)++;
        if (!equal || grazes(packets[k], i)) continue;
        const float far = packets[k].far[i];
        EXPECT_NEAR(beam.packets[k].far[i], far, 2e-4F * (1.0F + far));
      }
    }
  }
  EXPECT_GT(same, 12000);
  EXPECT_LT(other, same / 2000);  // at edges
}

INSTANTIATE_TEST_SUITE_P(Of, Beams,
                         testing::Values(Case{"pixels_at_the_origin", Vec3::Zero(), 0.002},
                                         Case{"pixels_far_up", {412.7, -371.3, 2900.1}, 0.002},
                                         Case{"coarse_pixels", {12.7, -71.3, 900.1}, 0.05},
                                         Case{"half_a_sphere", Vec3::Zero(), 0.3},
                                         Case{"too_wide_to_be_one", Vec3::Zero(), 0.6}),
                         [](const auto& test) { return std::string(test.param.name); });

TEST(BeamsAtEdges, NoneLeaksOutOfAClosedSurface) {
  // A cube of shared vertices seen from inside, with rays aimed at points of its edges as well as between.
  TexturedMesh cube;
  constexpr int kCells = 12;
  for (int face = 0; face < 6; ++face) {
    const int axis = face / 2;
    const auto first = static_cast<std::uint32_t>(cube.mesh.vertices.size());
    for (int j = 0; j <= kCells; ++j) {
      for (int i = 0; i <= kCells; ++i) {
        Vec3 p;
        p[axis] = face % 2 == 0 ? -20.0 : 20.0;
        p[(axis + 1) % 3] = -20.0 + 40.0 * i / kCells;
        p[(axis + 2) % 3] = -20.0 + 40.0 * j / kCells;
        cube.mesh.vertices.push_back(p);
      }
    }
    for (std::uint32_t j = 0; j < kCells; ++j) {
      for (std::uint32_t i = 0; i < kCells; ++i) {
        const std::uint32_t a = first + j * (kCells + 1) + i;
        cube.mesh.triangles.push_back({a, a + 1, a + kCells + 1});
        cube.mesh.triangles.push_back({a + 1, a + kCells + 2, a + kCells + 1});
      }
    }
  }
  const Scene scene({cube}, Vec3::Zero());
  std::mt19937_64 random(3);
  int rays = 0;
  for (int round = 0; round < 4000; ++round) {
    const auto& triangle = cube.mesh.triangles[random() % cube.mesh.triangles.size()];
    const Vec3 a = cube.mesh.vertices[triangle[0]], b = cube.mesh.vertices[triangle[1]];
    Beam beam(uniform_vector(random, 19.0), a - b, 1e-3, scene.anchor());
    for (int ray = 0; ray < 64; ++ray) {  // all along the edge
      const Vec3 target = a + (ray + 0.5) / 64.0 * (b - a);
      beam.directions[ray] = (target - beam.origin).normalized();
    }
    beam.write(scene.anchor());
    scene.intersect(beam.packets);
    for (int ray = 0; ray < 64; ++ray) {
      ASSERT_NE(beam.packet(ray).mesh[Beam::lane(ray)], RayPacket8::kMiss) << "round " << round << " ray " << ray;
      ++rays;
    }
  }
  EXPECT_EQ(rays, 4000 * 64);
}

TEST(BeamsAtEdges, OfEqualSurfacesTheFirstIsMet) {
  // The scenes hold the same ground five times, in two orders.
  const TexturedMesh field = ground(40, 50.0, Vec3::Zero());
  TexturedMesh twice = field;
  twice.mesh.triangles.insert(twice.mesh.triangles.end(), field.mesh.triangles.begin(), field.mesh.triangles.end());
  const auto count = static_cast<std::uint32_t>(field.mesh.triangles.size());
  const auto answers = [&](std::size_t threads) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    const Scene scene({twice, twice, field});
    std::mt19937_64 random(4);
    std::vector<std::uint32_t> triangles;
    for (int round = 0; round < 200; ++round) {
      const Vec3 corner = field.mesh.vertices[random() % field.mesh.vertices.size()];
      Beam beam(corner + Vec3(0.1, 0.2, 15.0), Vec3(-0.1, -0.2, -15.0), 0.01, scene.anchor());
      scene.intersect(beam.packets);
      for (const RayPacket8& packet : beam.packets) {
        for (int i = 0; i < 8; ++i) {
          if (packet.mesh[i] == RayPacket8::kMiss) continue;
          EXPECT_EQ(packet.mesh[i], 0U);
          EXPECT_LT(packet.triangle[i], count);
          triangles.push_back(packet.triangle[i]);
        }
      }
    }
    return triangles;
  };
  const auto reference = answers(1);
  EXPECT_GT(reference.size(), 10000U);
  for (const std::size_t threads : {2U, 2U, 3U}) EXPECT_EQ(answers(threads), reference);
}

TEST(BeamsAtEdges, TheGroundBelowTheCameraIsMetThoughItsCornersLieBehind) {
  TexturedMesh plane;
  plane.mesh.vertices = {{-1e4, -1e4, 0}, {1e4, -1e4, 0}, {0, 2e4, 0}};
  plane.mesh.triangles = {{0, 1, 2}};
  const Scene scene({plane}, Vec3::Zero());
  for (const double height_m : {2.0, 50.0, 500.0}) {
    Beam beam(Vec3(3.0, 4.0, height_m), Vec3(0.6, 0.3, -0.2), 0.02, scene.anchor());
    scene.intersect(beam.packets);
    for (int ray = 0; ray < 64; ++ray) {
      const double expected_m = height_m / -beam.directions[ray].z();
      ASSERT_EQ(beam.packet(ray).mesh[Beam::lane(ray)], 0U);
      EXPECT_NEAR(beam.packet(ray).far[Beam::lane(ray)], expected_m, 1e-5 * expected_m);
    }
  }
}

TEST(BeamsAtEdges, TrianglesWithoutAreaAndThoseSeenEdgeOnAreNotThere) {
  TexturedMesh odd = ground(4, 20.0, Vec3(0, 0, -10.0));
  const auto first = static_cast<std::uint32_t>(odd.mesh.vertices.size());
  odd.mesh.vertices.insert(odd.mesh.vertices.end(),
                           {{0, 0, 5}, {0, 0, 5}, {0, 0, 5}, {0, 0, 1}, {0, 0, -1}, {1, 0, 0}});
  odd.mesh.triangles.push_back({first, first + 1, first + 2});      // a point
  odd.mesh.triangles.push_back({first, first + 3, first + 4});      // a line through the camera's way
  odd.mesh.triangles.push_back({first + 3, first + 4, first + 5});  // in the plane of the camera and its rays
  const Scene scene({odd}, Vec3::Zero());
  Beam beam(Vec3(0, 0, 8.0), Vec3(1e-9, 0, -1.0), 0.004, scene.anchor());
  scene.intersect(beam.packets);
  for (int ray = 0; ray < 64; ++ray) {
    const RayPacket8& packet = beam.packet(ray);
    ASSERT_EQ(packet.mesh[Beam::lane(ray)], 0U);
    EXPECT_LT(packet.triangle[Beam::lane(ray)], 32U);
    EXPECT_NEAR(packet.far[Beam::lane(ray)], 18.0, 2.0);
  }
}

TEST(BeamsAtEdges, SurfacesOfAllMagnitudesHideNoWall) {
  std::mt19937_64 random(6);
  TexturedMesh odd;
  odd.mesh.vertices = {{-100, -100, -10}, {200, -100, -10}, {-100, 200, -10}};
  odd.mesh.triangles = {{0, 1, 2}};
  for (int i = 0; i < 2000; ++i) {  // from what is nothing in floats to what has no area there for its size
    const double size = std::pow(10.0, uniform(random, -40.0, 37.0));
    const auto first = static_cast<std::uint32_t>(odd.mesh.vertices.size());
    for (int corner = 0; corner < 3; ++corner) {
      odd.mesh.vertices.push_back(Vec3(0, 0, -11.0) + size * (uniform_vector(random, 1.0) - Vec3(0, 0, 1.0)));
    }
    odd.mesh.triangles.push_back({first, first + 1, first + 2});
  }
  const Scene scene({odd}, Vec3::Zero());
  Beam beam(Vec3::Zero(), Vec3(0.1, 0.2, -1.0), 0.01, scene.anchor());
  scene.intersect(beam.packets);
  for (int ray = 0; ray < 64; ++ray) {
    ASSERT_EQ(beam.packet(ray).mesh[Beam::lane(ray)], 0U);
    EXPECT_EQ(beam.packet(ray).triangle[Beam::lane(ray)], 0U);
    EXPECT_NEAR(beam.packet(ray).far[Beam::lane(ray)], 10.0 / -beam.directions[ray].z(), 1e-4);
  }
}

TEST(BeamsAtEdges, ADepthOfCoincidentTrianglesIsNoDeepTree) {
  TexturedMesh pile;
  for (std::uint32_t i = 0; i < 50000; ++i) {
    for (const Vec3& corner : {Vec3(-5, -5, -9), Vec3(9, -5, -9), Vec3(-5, 9, -9)})
      pile.mesh.vertices.push_back(corner);
    pile.mesh.triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
  }
  const Scene scene({pile}, Vec3::Zero());
  Beam beam(Vec3::Zero(), Vec3(0, 0, -1.0), 0.01, scene.anchor());
  scene.intersect(beam.packets);
  for (const RayPacket8& packet : beam.packets) {
    for (int i = 0; i < 8; ++i) {
      EXPECT_EQ(packet.mesh[i], 0U);
      EXPECT_EQ(packet.triangle[i], 0U);
    }
  }
}

TEST(BeamsAtEdges, LanesThatAreOffMissAndTheOthersDoNotCare) {
  std::mt19937_64 random(9);
  const Scene scene({ground(60, 80.0, Vec3::Zero())});
  for (int round = 0; round < 100; ++round) {
    const Beam whole(Vec3(0, 0, 20.0), uniform_vector(random, 0.5) - Vec3(0, 0, 1.0), 0.01, scene.anchor());
    auto all = whole.packets;
    scene.intersect(all);
    auto some = whole.packets;
    for (RayPacket8& packet : some) {
      for (int i = 0; i < 8; ++i) {
        if (random() % 3 == 0) packet.disable_lane(i);
      }
    }
    const auto given = some;
    scene.intersect(some);
    for (std::size_t k = 0; k < some.size(); ++k) {
      for (int i = 0; i < 8; ++i) {
        const bool on = given[k].far[i] > 0.0F;
        EXPECT_EQ(some[k].mesh[i], on ? all[k].mesh[i] : RayPacket8::kMiss);
        EXPECT_EQ(some[k].far[i], on ? all[k].far[i] : given[k].far[i]);
      }
    }
  }
}

TEST(BeamsAtEdges, ABeamMayBeASinglePacketOrAll) {
  const Scene scene({ground(60, 80.0, Vec3::Zero())});
  const Beam beam(Vec3(0, 0, 20.0), Vec3(0.1, 0.2, -1.0), 0.01, scene.anchor());
  auto all = beam.packets;
  scene.intersect(all);
  for (std::size_t count = 1; count < 8; ++count) {
    auto some = beam.packets;
    scene.intersect(std::span(some).first(count));
    for (std::size_t k = 0; k < count; ++k) {
      for (int i = 0; i < 8; ++i) EXPECT_NEAR(some[k].far[i], all[k].far[i], 1e-5F * all[k].far[i]);
    }
    EXPECT_EQ(some[count].mesh[0], RayPacket8::kMiss);
  }
}

/// Far, small and steep: without care, edge functions of the corners would lose all their precision.
TEST(BeamsAtEdges, SmallTrianglesFarAwayKeepTheirPlaceAndDepth) {
  std::mt19937_64 random(5);
  const Vec3 center(2000.0, 300.0, 100.0);
  const std::vector<TexturedMesh> meshes{ground(100, 5.0, center)};  // 5 cm, 2 km away
  const Scene scene(meshes, Vec3(1990.0, 290.0, 90.0));
  int compared = 0;
  double worst_m = 0.0;
  for (int round = 0; round < 20; ++round) {
    const Vec3 origin(0.0, 0.0, 1500.0);
    const Vec3 target = center + Vec3(uniform(random, -2.0, 2.0), uniform(random, -2.0, 2.0), 0.0);
    Beam beam(origin, target - origin, 3e-5, scene.anchor());
    if (round % 2 == 1) {  // most look elsewhere, so that the triangles are far from the beam's axis
      for (int ray = 0; ray < 40; ++ray)
        beam.directions[ray] = (beam.directions[ray] + Vec3(-0.8, 0.9, 0.3)).normalized();
      beam.write(scene.anchor());
    }
    scene.intersect(beam.packets);
    for (int ray = 0; ray < 64; ++ray) {
      const Met met = brute_force(meshes, beam.origin, beam.directions[ray]);
      if (!std::isfinite(met.distance_m)) continue;
      ++compared;
      ASSERT_NE(beam.packet(ray).mesh[Beam::lane(ray)], RayPacket8::kMiss);
      EXPECT_NEAR(beam.packet(ray).far[Beam::lane(ray)], met.distance_m, 1e-6 * met.distance_m);
      const RayPacket8& packet = beam.packet(ray);
      const int i = Beam::lane(ray);
      const Vec3 at = scene.position({met.distance_m, packet.mesh[i], packet.triangle[i], packet.u[i], packet.v[i]});
      worst_m = std::max(worst_m, (at - (beam.origin + met.distance_m * beam.directions[ray])).norm());
    }
  }
  EXPECT_LT(worst_m, 0.002);
  EXPECT_GT(compared, 800);
}

}  // namespace
}  // namespace tileflight::scene::beam_traversal_test
