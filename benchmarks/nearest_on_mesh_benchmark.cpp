// Distances from 2 million points to a terrain of 800 000 triangles, including construction of the tree. Peer: Embree's
// point query on the same triangles (floats). Both use both cores.
#include <benchmark/benchmark.h>
#include <tbb/parallel_for.h>

#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "tests/height_field.h"
#include "tileflight/core/geometry/triangle_index.h"
#include "tileflight/evaluation/metrics/distances.h"
#include "tileflight/world/scene/embree.h"

namespace {

using tileflight::geometry::TriangleMesh;
using tileflight::geometry::Vec3;

constexpr std::uint32_t kCells = 632;
constexpr std::size_t kPoints = 2'000'000;
constexpr double kSize_m = 250.0;

double height_m(double x, double y) {
  return 20.0 + 8.0 * std::sin(0.03 * x) * std::cos(0.05 * y) + 2.0 * std::sin(0.4 * x + 0.2 * y);
}

const TriangleMesh& terrain() {
  static const TriangleMesh cached = tileflight::tests::height_field(kCells, 0.0, kSize_m, height_m);
  return cached;
}

/// Points near the surface (0.3 m off), in random order.
const std::vector<Vec3>& points() {
  static const std::vector<Vec3> cached = [] {
    std::mt19937 random(1);
    std::uniform_real_distribution<double> place(0.0, kSize_m);
    std::normal_distribution<double> noise(0.0, 0.3);
    std::vector<Vec3> result(kPoints);
    for (Vec3& p : result) {
      const double x = place(random), y = place(random);
      p = Vec3(x + noise(random), y + noise(random), height_m(x, y) + noise(random));
    }
    return result;
  }();
  return cached;
}

void nearest_on_mesh(benchmark::State& state) {
  terrain();
  points();
  double sum = 0.0;
  for (auto _ : state) {
    const tileflight::geometry::TriangleIndex index(terrain());
    std::vector<double> distances(kPoints);
    tbb::parallel_for(std::size_t{0}, kPoints,
                      [&](std::size_t i) { distances[i] = index.nearest(points()[i])->distance_m; });
    sum = 0.0;
    for (const double d : distances) sum += d;
  }
  state.counters["mean_m"] = sum / kPoints;
}

/// Searches as `evaluate` does: along a space-filling curve, each search bounded by the previous one.
void nearest_on_mesh_walk(benchmark::State& state) {
  terrain();
  tileflight::geometry::PointCloud cloud;
  cloud.positions = points();
  double sum = 0.0;
  for (auto _ : state) {
    sum = 0.0;
    for (const double d : tileflight::metrics::surface_distances(cloud, tileflight::geometry::TriangleIndex(terrain())))
      sum += d;
  }
  state.counters["mean_m"] = sum / kPoints;
}

struct EmbreeQuery {
  const std::vector<Eigen::Vector3f>* vertices;
  float best;
};

bool embree_visit(RTCPointQueryFunctionArguments* args) {
  auto* query = static_cast<EmbreeQuery*>(args->userPtr);
  const auto& t = terrain().triangles[args->primID];
  const Vec3 p(args->query->x, args->query->y, args->query->z);
  const auto corner = [&](std::size_t k) { return Vec3((*query->vertices)[t[k]].cast<double>()); };
  const Vec3 q = tileflight::geometry::closest_point_on_triangle(p, corner(0), corner(1), corner(2));
  const auto distance = static_cast<float>((q - p).norm());
  if (distance >= query->best) return false;
  query->best = distance;
  args->query->radius = distance;
  return true;
}

void nearest_on_mesh_embree(benchmark::State& state) {
  terrain();
  points();
  std::vector<Eigen::Vector3f> vertices;
  for (const Vec3& v : terrain().vertices) vertices.push_back(v.cast<float>());
  double sum = 0.0;
  for (auto _ : state) {
    RTCDevice device = rtcNewDevice(nullptr);
    RTCScene scene = rtcNewScene(device);
    RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
    rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, vertices.data(), 0, 12,
                               vertices.size());
    rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, terrain().triangles.data(), 0, 12,
                               terrain().triangles.size());
    rtcSetGeometryPointQueryFunction(geometry, embree_visit);
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(scene, geometry);
    rtcCommitScene(scene);
    std::vector<float> distances(kPoints);
    tbb::parallel_for(std::size_t{0}, kPoints, [&](std::size_t i) {
      EmbreeQuery user{&vertices, std::numeric_limits<float>::infinity()};
      const Eigen::Vector3f p = points()[i].cast<float>();
      RTCPointQuery query{p.x(), p.y(), p.z(), 0.0F, std::numeric_limits<float>::infinity()};
      RTCPointQueryContext context;
      rtcInitPointQueryContext(&context);
      rtcPointQuery(scene, &query, &context, nullptr, &user);
      distances[i] = user.best;
    });
    sum = 0.0;
    for (const float d : distances) sum += d;
    rtcReleaseGeometry(geometry);
    rtcReleaseScene(scene);
    rtcReleaseDevice(device);
  }
  state.counters["mean_m"] = sum / kPoints;
}

}  // namespace

BENCHMARK(nearest_on_mesh)->Unit(benchmark::kMillisecond)->MeasureProcessCPUTime()->UseRealTime();
BENCHMARK(nearest_on_mesh_walk)->Unit(benchmark::kMillisecond)->MeasureProcessCPUTime()->UseRealTime();
BENCHMARK(nearest_on_mesh_embree)->Unit(benchmark::kMillisecond)->MeasureProcessCPUTime()->UseRealTime();
