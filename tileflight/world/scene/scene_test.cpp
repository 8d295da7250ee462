#include "tileflight/world/scene/scene.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/task_group.h>

#include <cmath>
#include <cstddef>
#include <cstring>
#include <limits>
#include <new>
#include <numbers>
#include <random>
#include <stdexcept>

#include "tileflight/core/base/input_error.h"
#include "tileflight/world/scene/packets.h"
#include "tileflight/world/scene/test_shapes.h"

namespace tileflight::scene::scene_test {
namespace {

using geometry::Vec3;
using imaging::TexturedMesh;
using test_shapes::uniform;
using test_shapes::uniform_vector;

TexturedMesh random_triangles(std::mt19937_64& random, int count, const Vec3& center, double half_m) {
  TexturedMesh mesh;
  for (int i = 0; i < count; ++i) {
    const Vec3 base = center + uniform_vector(random, half_m);
    const auto first = static_cast<std::uint32_t>(mesh.mesh.vertices.size());
    for (int corner = 0; corner < 3; ++corner) {
      mesh.mesh.vertices.push_back(base + uniform_vector(random, 0.15 * half_m));
    }
    mesh.mesh.triangles.push_back({first, first + 1, first + 2});
  }
  return mesh;
}

/// Rolling ground of shared vertices.
TexturedMesh height_field(int cells, double size_m, const Vec3& center) {
  return test_shapes::height_field(cells, size_m, center,
                                   [](double x, double y) { return 3.0 * std::sin(0.07 * x) * std::cos(0.05 * y); });
}

/// Moeller and Trumbore 1997, in double: distance along the ray, or infinity. `margin`: how far inside the triangle the
/// hit lies (smallest barycentric weight).
struct Crossing {
  double distance_m = std::numeric_limits<double>::infinity();
  double margin = 0.0;
};
Crossing moeller_trumbore(const Ray& ray, const Vec3& a, const Vec3& b, const Vec3& c) {
  const Vec3 e1 = b - a;
  const Vec3 e2 = c - a;
  const Vec3 p = ray.direction.cross(e2);
  const double determinant = e1.dot(p);
  if (determinant == 0.0) return {};
  const Vec3 s = ray.origin - a;
  const Vec3 q = s.cross(e1);
  const double u = s.dot(p) / determinant;
  const double v = ray.direction.dot(q) / determinant;
  const double t = e2.dot(q) / determinant;
  const double margin = std::min({u, v, 1.0 - u - v});
  if (margin < 0.0 || t < 0.0) return {};
  return {t, margin};
}

Crossing brute_force(const std::vector<TexturedMesh>& meshes, const Ray& ray) {
  Crossing nearest;
  for (const TexturedMesh& mesh : meshes) {
    for (const geometry::Triangle& t : mesh.mesh.triangles) {
      const auto& p = mesh.mesh.vertices;
      const Crossing crossing = moeller_trumbore(ray, p[t[0]], p[t[1]], p[t[2]]);
      if (crossing.distance_m < nearest.distance_m) nearest = crossing;
    }
  }
  return nearest;
}

constexpr double kClearMargin = 1e-4;  // float rounding cannot change hits this far inside

struct Frame {
  const char* name;
  Vec3 center;
};

class SceneAgainstBruteForce : public testing::TestWithParam<Frame> {};

TEST_P(SceneAgainstBruteForce, NearestHitsAgree) {
  const Vec3 center = GetParam().center;
  std::mt19937_64 random(7);
  const std::vector<TexturedMesh> meshes{random_triangles(random, 150, center, 40.0),
                                         random_triangles(random, 1, center, 40.0),
                                         random_triangles(random, 150, center, 40.0)};
  const Scene scene(meshes);
  int hits = 0;
  int compared = 0;
  for (int i = 0; i < 4000; ++i) {
    const Ray ray{center + uniform_vector(random, 60.0), uniform_vector(random, 1.0).normalized()};
    const Crossing expected = brute_force(meshes, ray);
    const auto hit = scene.intersect(ray);
    if (std::isfinite(expected.distance_m) && expected.margin < kClearMargin) continue;
    ++compared;
    ASSERT_EQ(hit.has_value(), std::isfinite(expected.distance_m)) << "ray " << i;
    if (!hit) continue;
    ++hits;
    EXPECT_NEAR(hit->distance_m, expected.distance_m, 1e-6);
    EXPECT_LT((scene.position(*hit) - (ray.origin + hit->distance_m * ray.direction)).norm(), 1e-3);
    EXPECT_FALSE(scene.is_occluded(ray, hit->distance_m - 1e-3));
    EXPECT_TRUE(scene.is_occluded(ray, hit->distance_m + 1e-3));
    EXPECT_FALSE(scene.intersect(ray, hit->distance_m - 1e-3).has_value());
  }
  EXPECT_GT(hits, 400);
  EXPECT_GT(compared, 3950);
}

INSTANTIATE_TEST_SUITE_P(Frames, SceneAgainstBruteForce,
                         testing::Values(Frame{"at_origin", Vec3::Zero()}, Frame{"far_up", {412.7, -371.3, 2900.123}},
                                         Frame{"national_grid", {500123.4, 4100456.7, 2900.0}}),
                         [](const auto& test) { return std::string(test.param.name); });

void build_frame(RayPacket8& packet, int lane, const Ray& ray, const Vec3& anchor) {
  const Vec3 origin = ray.origin - anchor;
  packet.origin_x[lane] = static_cast<float>(origin.x());
  packet.origin_y[lane] = static_cast<float>(origin.y());
  packet.origin_z[lane] = static_cast<float>(origin.z());
  packet.direction_x[lane] = static_cast<float>(ray.direction.x());
  packet.direction_y[lane] = static_cast<float>(ray.direction.y());
  packet.direction_z[lane] = static_cast<float>(ray.direction.z());
}

TEST(Scene, PacketsAgreeWithSingleRaysAndKeepLanesOff) {
  std::mt19937_64 random(11);
  const Scene scene({height_field(40, 200.0, {10.0, 20.0, 2900.0})});
  for (int round = 0; round < 400; ++round) {
    RayPacket8 packet;
    packet.reset();
    std::vector<Ray> rays;
    for (int lane = 0; lane < RayPacket8::kLanes; ++lane) {
      const Vec3 above(uniform(random, -90.0, 110.0), uniform(random, -80.0, 120.0), 2940.0);
      const Vec3 down = (uniform_vector(random, 1.0) - Vec3(0.0, 0.0, 1.2)).normalized();
      rays.push_back({above, down});
      build_frame(packet, lane, rays.back(), scene.anchor());
    }
    packet.disable_lane(round % 8);
    scene.intersect(packet);
    EXPECT_EQ(packet.mesh[round % 8], RayPacket8::kMiss);
    for (int lane = 0; lane < RayPacket8::kLanes; ++lane) {
      if (lane == round % 8) continue;
      const auto single = scene.intersect(rays[lane]);
      ASSERT_EQ(packet.mesh[lane] != RayPacket8::kMiss, single.has_value());
      if (single) {
        EXPECT_NEAR(packet.far[lane], single->distance_m, 2e-3);
      }
    }
  }
}

TEST(Scene, OcclusionOfPacketsAgreesWithSingleRays) {
  std::mt19937_64 random(12);
  const Scene scene({height_field(40, 200.0, {10.0, 20.0, 2900.0})});
  int hidden = 0;
  for (int round = 0; round < 400; ++round) {
    RayPacket8 packet;
    packet.reset();
    std::vector<Ray> rays;
    for (int lane = 0; lane < RayPacket8::kLanes; ++lane) {
      const Vec3 near(uniform(random, -60.0, 80.0), uniform(random, -50.0, 90.0), 2902.0);
      rays.push_back({near, (uniform_vector(random, 1.0) + Vec3(0.0, 0.0, 0.2)).normalized()});
      build_frame(packet, lane, rays.back(), scene.anchor());
      packet.far[lane] = 1e4F;
    }
    packet.disable_lane(round % 8);
    scene.test_occlusion(packet);
    for (int lane = 0; lane < RayPacket8::kLanes; ++lane) {
      const bool expected = lane == round % 8 || scene.is_occluded(rays[lane], 1e4);
      ASSERT_EQ(packet.far[lane] < 0.0F, expected);
      EXPECT_EQ(packet.mesh[lane], RayPacket8::kMiss);
      hidden += expected ? 1 : 0;
    }
  }
  EXPECT_GT(hidden, 800);
  EXPECT_LT(hidden, 2800);
}

/// Fraction of rays aimed from above at points of the field's inner edges (`along` 0..1) that hit nothing.
double leaking_share(double along_low, double along_high) {
  const Vec3 center(331.3, -127.9, 2893.0);
  const TexturedMesh field = height_field(30, 60.0, center);
  const Scene scene({field});
  std::mt19937_64 random(3);
  int cast = 0;
  int leaked = 0;
  for (const geometry::Triangle& t : field.mesh.triangles) {
    for (int edge = 0; edge < 3; ++edge) {
      const Vec3& a = field.mesh.vertices[t[edge]];
      const Vec3& b = field.mesh.vertices[t[(edge + 1) % 3]];
      const Vec3 target = a + uniform(random, along_low, along_high) * (b - a);
      if (((target - center).cwiseAbs().head<2>().array() > 29.5).any()) continue;  // the field's own rim
      const Vec3 origin = center + Vec3(uniform(random, -9.0, 9.0), uniform(random, -9.0, 9.0), 40.0);
      ++cast;
      if (!scene.intersect({origin, (target - origin).normalized()})) ++leaked;
    }
  }
  EXPECT_GT(cast, 4000);
  return static_cast<double>(leaked) / cast;
}

TEST(Scene, RaysThroughSharedEdgesDoNotLeak) { EXPECT_EQ(leaking_share(0.001, 0.999), 0.0); }

TEST(Scene, RaysAtTheVeryCornerSeldomLeak) { EXPECT_LT(leaking_share(0.0, 0.0), 0.005); }

TEST(Scene, NormalFollowsTheWindingAndPositionTheSurface) {
  TexturedMesh triangle;
  triangle.mesh.vertices = {{0, 0, 2900}, {10, 0, 2900}, {0, 10, 2900}};
  triangle.mesh.triangles = {{0, 1, 2}};
  const Scene scene({triangle});
  for (const double side : {1.0, -1.0}) {
    const auto hit = scene.intersect({Vec3(2, 3, 2900 + 5 * side), Vec3(0, 0, -side)});
    ASSERT_TRUE(hit.has_value());
    EXPECT_DOUBLE_EQ(hit->distance_m, 5.0);
    EXPECT_LT((scene.position(*hit) - Vec3(2, 3, 2900)).norm(), 1e-5);
    EXPECT_LT((scene.normal(*hit) - Vec3(0, 0, 1)).norm(), 1e-12);
    EXPECT_NEAR(hit->u, 0.2, 1e-6);
    EXPECT_NEAR(hit->v, 0.3, 1e-6);
  }
}

TEST(Scene, KeepsMillimetresFarFromTheOrigin) {
  const Vec3 center(700.4, -650.9, 2901.7);
  const Scene scene({height_field(64, 400.0, center)});
  std::mt19937_64 random(5);
  double worst_m = 0.0;
  for (int i = 0; i < 2000; ++i) {
    const Vec3 above = center + Vec3(uniform(random, -190.0, 190.0), uniform(random, -190.0, 190.0), 45.0);
    RayPacket8 packet;
    packet.reset();
    for (int lane = 0; lane < 8; ++lane) build_frame(packet, lane, {above, -Vec3::UnitZ()}, scene.anchor());
    scene.intersect(packet);
    const auto single = scene.intersect({above, -Vec3::UnitZ()});
    ASSERT_TRUE(single.has_value());
    worst_m = std::max(worst_m, std::abs(packet.far[0] - single->distance_m));
  }
  EXPECT_LT(worst_m, 1e-3);
}

TEST(Scene, TheSameHitsWhateverTheNumberOfThreadsThatBuiltIt) {
  // Coincident triangles and rays through shared vertices make every hit a tie, resolved only by the tree's order.
  TexturedMesh field = height_field(400, 100.0, Vec3::Zero());
  const auto once = field.mesh.triangles;
  field.mesh.triangles.insert(field.mesh.triangles.end(), once.begin(), once.end());
  const auto answers = [&](std::size_t threads) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    const Scene scene({field});
    std::vector<std::uint32_t> triangles;
    for (const Vec3& vertex : field.mesh.vertices) {
      const Vec3 above = vertex + Vec3(0.0, 0.0, 20.0);
      const auto hit = scene.intersect({above, -Vec3::UnitZ()});
      triangles.push_back(hit ? hit->triangle : RayPacket8::kMiss);
    }
    return triangles;
  };
  const auto reference = answers(1);
  for (const std::size_t threads : {2U, 2U, 3U}) EXPECT_EQ(answers(threads), reference) << threads << " threads";
}

/// Runs `work` as the task of an algorithm and overwrites the memory of the algorithm's context afterwards.
template <class Work>
void run_in_algorithm_that_ends(const Work& work) {
  alignas(tbb::task_group_context) static std::byte memory[sizeof(tbb::task_group_context)];
  auto* context = new (memory) tbb::task_group_context;
  tbb::parallel_for(
      0, 1, [&](int) { work(); }, tbb::simple_partitioner(), *context);
  context->~task_group_context();
  std::memset(memory, 0x48, sizeof memory);
}

// A cancellation visits the parents of all task contexts, so a tree must keep none of an algorithm that is gone.
TEST(Scene, TreesBuiltWithinAnAlgorithmDoNotKeepItsContext) {
  const Scene scene({height_field(60, 100.0, Vec3::Zero())});
  run_in_algorithm_that_ends([&] {
    scene.build_ray_tree();
    scene.build_beam_tree();
  });
  const auto fail = [] {
    tbb::parallel_for(0, 1, [](int) {
      tbb::parallel_for(0, 1, [](int) {});  // only a context with children visits the others
      throw std::runtime_error("no space left");
    });
  };
  EXPECT_THAT(fail, testing::ThrowsMessage<std::runtime_error>("no space left"));
}

TEST(Scene, MergedKeepsEveryTriangle) {
  std::mt19937_64 random(2);
  const std::vector<TexturedMesh> meshes{random_triangles(random, 5, Vec3::Zero(), 1.0), TexturedMesh{},
                                         random_triangles(random, 7, Vec3::Ones(), 1.0)};
  const geometry::TriangleMesh all = merge_meshes(meshes);
  ASSERT_EQ(all.triangles.size(), 12U);
  ASSERT_EQ(all.vertices.size(), 36U);
  EXPECT_EQ(all.vertices[all.triangles[6][2]], meshes[2].mesh.vertices[meshes[2].mesh.triangles[1][2]]);
}

TEST(Scene, KnowsItsBoundsAndMeshes) {
  std::mt19937_64 random(2);
  TexturedMesh unused;
  unused.mesh.vertices = {Vec3(1e6, 0, 0)};  // no triangle: not part of the place
  const Scene scene({height_field(4, 8.0, {100, 50, 30}), unused});
  EXPECT_EQ(scene.triangle_count(), 32U);
  EXPECT_EQ(scene.meshes().size(), 2U);
  EXPECT_NEAR(scene.bounds().max().x(), 104.0, 1e-9);
  EXPECT_LT((scene.anchor() - scene.bounds().center()).norm(), 1e-9);
}

TexturedMesh one_triangle() {
  TexturedMesh triangle;
  triangle.name = "tile 7";
  triangle.mesh.vertices = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  triangle.mesh.triangles = {{0, 1, 2}};
  return triangle;
}

void expect_refused(const TexturedMesh& mesh, const std::string& cause) {
  try {
    const Scene scene({mesh});
    FAIL() << "accepted: " << cause;
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr(cause));
  }
}

TEST(Scene, RefusesWhatItCannotShow) {
  expect_refused(TexturedMesh{}, "no triangle");
  TexturedMesh mesh = one_triangle();
  mesh.mesh.vertices[1].y() = std::numeric_limits<double>::quiet_NaN();
  expect_refused(mesh, "tile 7: a vertex is not finite");
  mesh = one_triangle();
  mesh.mesh.triangles[0][2] = 3;
  expect_refused(mesh, "a vertex that does not exist");
  mesh = one_triangle();
  mesh.uv.resize(2, Eigen::Vector2f::Zero());
  expect_refused(mesh, "2 texture coordinates for 3 vertices");
  mesh = one_triangle();
  mesh.uv.resize(3, Eigen::Vector2f::Constant(std::numeric_limits<float>::infinity()));
  expect_refused(mesh, "texture coordinate is not finite");
  mesh = one_triangle();
  mesh.colors.resize(4);
  expect_refused(mesh, "4 colours for 3 vertices");
  mesh = one_triangle();
  mesh.texture = std::make_shared<imaging::RgbImage>();
  expect_refused(mesh, "no pixels");
}

}  // namespace
}  // namespace tileflight::scene::scene_test
