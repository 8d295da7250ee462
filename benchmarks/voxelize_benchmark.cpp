// Voxelization of a terrain of 800 000 triangles of about half a metre, as from a photogrammetric survey of 250 m x 250
// m. Peer: the straightforward single-threaded way, which tests every cell of a triangle's bounding box by the 13
// separating axes into a dense bitmap. For real data, TILEFLIGHT_BENCHMARK_MESH names a PLY mesh; the box is then its
// bounds.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <vector>

#include "tests/height_field.h"
#include "tileflight/tiles/mesh_files/ply_meshes.h"
#include "tileflight/world/ground_truth/voxelize.h"

namespace {

using tileflight::geometry::Box3;
using tileflight::geometry::TriangleMesh;
using tileflight::geometry::Vec3;

constexpr std::uint32_t kCells = 632;
constexpr double kSize_m = 250.0;

double height_m(double x, double y) {
  return 20.0 + 8.0 * std::sin(0.03 * x) * std::cos(0.05 * y) + 2.0 * std::sin(0.4 * x + 0.2 * y) +
         0.3 * std::sin(3.1 * x) * std::sin(2.7 * y);
}

struct Input {
  TriangleMesh mesh;
  Box3 box;
};

const Input& input() {
  static const Input cached = [] {
    const char* file = std::getenv("TILEFLIGHT_BENCHMARK_MESH");
    if (file == nullptr)
      return Input{tileflight::tests::height_field(kCells, 0.0, kSize_m, height_m),
                   Box3(Vec3::Zero(), Vec3(kSize_m, kSize_m, 48.0))};
    TriangleMesh mesh = tileflight::mesh_files::read_ply_meshes(file, false).meshes.front().mesh;
    const Box3 box = tileflight::geometry::bounds(mesh);
    return Input{std::move(mesh), box};
  }();
  return cached;
}

/// A separating axis: the projections of the triangle and of a cell centred at the origin.
struct Axis {
  Vec3 direction;
  double low, high;  ///< cells whose projected centre is outside this interval are separated
};

/// The 10 axes not covered by the bounding box: the normal, and the cross products of the sides and the grid's axes.
std::array<Axis, 10> axes_of(const std::array<Vec3, 3>& t, double half_m) {
  std::array<Axis, 10> axes;
  const std::array<Vec3, 3> sides{t[1] - t[0], t[2] - t[1], t[0] - t[2]};
  axes[0].direction = sides[0].cross(sides[1]);
  for (std::size_t i = 0; i < 9; ++i) axes[i + 1].direction = Vec3::Unit(static_cast<int>(i % 3)).cross(sides[i / 3]);
  for (Axis& axis : axes) {
    const double a = axis.direction.dot(t[0]), b = axis.direction.dot(t[1]), c = axis.direction.dot(t[2]);
    const double reach = half_m * axis.direction.lpNorm<1>();
    axis.low = std::min({a, b, c}) - reach;
    axis.high = std::max({a, b, c}) + reach;
  }
  return axes;
}

bool overlaps(const std::array<Axis, 10>& axes, const Vec3& center) {
  for (const Axis& axis : axes) {
    const double projection = axis.direction.dot(center);
    if (projection < axis.low || projection > axis.high) return false;
  }
  return true;
}

/// The peer: the number of occupied cells, from a dense bitmap.
std::int64_t straightforward(const TriangleMesh& mesh, const Box3& box, double edge_m) {
  std::array<std::int64_t, 3> dims{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    dims[axis] = std::max<std::int64_t>(1, std::llround(box.sizes()[static_cast<int>(axis)] / edge_m));
  }
  std::vector<bool> bits(static_cast<std::size_t>(dims[0] * dims[1] * dims[2]));
  for (const auto& triangle : mesh.triangles) {
    std::array<Vec3, 3> t;
    for (std::size_t k = 0; k < 3; ++k) t[k] = mesh.vertices[triangle[k]] - box.min();
    std::array<std::int64_t, 3> low{}, high{};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const int a = static_cast<int>(axis);
      low[axis] = std::max<std::int64_t>(
          0, static_cast<std::int64_t>(std::floor(std::min({t[0][a], t[1][a], t[2][a]}) / edge_m)));
      high[axis] = std::min(dims[axis] - 1,
                            static_cast<std::int64_t>(std::floor(std::max({t[0][a], t[1][a], t[2][a]}) / edge_m)));
    }
    const auto axes = axes_of(t, 0.5 * edge_m);
    for (std::int64_t x = low[0]; x <= high[0]; ++x) {
      for (std::int64_t y = low[1]; y <= high[1]; ++y) {
        for (std::int64_t z = low[2]; z <= high[2]; ++z) {
          const auto index = static_cast<std::size_t>((x * dims[1] + y) * dims[2] + z);
          if (bits[index]) continue;
          const Vec3 center = edge_m * (Vec3(static_cast<double>(x), static_cast<double>(y), static_cast<double>(z)) +
                                        Vec3::Constant(0.5));
          if (overlaps(axes, center)) bits[index] = true;
        }
      }
    }
  }
  return std::count(bits.begin(), bits.end(), true);
}

void voxelize(benchmark::State& state) {
  const double edge_m = 0.01 * static_cast<double>(state.range(0));
  input();
  std::size_t cells = 0;
  for (auto _ : state) cells = tileflight::ground_truth::voxelize(input().mesh, input().box, edge_m).occupied.size();
  state.counters["cells"] = static_cast<double>(cells);
}

void voxelize_straightforward(benchmark::State& state) {
  const double edge_m = 0.01 * static_cast<double>(state.range(0));
  input();
  std::int64_t cells = 0;
  for (auto _ : state) cells = straightforward(input().mesh, input().box, edge_m);
  state.counters["cells"] = static_cast<double>(cells);
}

}  // namespace

BENCHMARK(voxelize)
    ->ArgName("edge_cm")
    ->Arg(100)
    ->Arg(25)
    ->Arg(10)
    ->Unit(benchmark::kMillisecond)
    ->MeasureProcessCPUTime()
    ->UseRealTime();
BENCHMARK(voxelize_straightforward)
    ->ArgName("edge_cm")
    ->Arg(100)
    ->Arg(25)
    ->Arg(10)
    ->Unit(benchmark::kMillisecond)
    ->MeasureProcessCPUTime()
    ->UseRealTime();
