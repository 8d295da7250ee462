// Registration of a map of 84 029 points (0.3 m noise), displaced by 2 degrees and (0.6, -0.5, 0.3) m, to the centres
// of the 1 m voxels that a place of 250 m x 250 m touches, and to its surface. On a task of this size (two cores,
// reference task) PCL 1.13 takes 19.1 s, CloudCompare 9.0, Open3D 8.3 and small_gicp 5.05. A textbook implementation is
// measured for comparison. Times include construction of the trees. Accuracy: RMS distance of the aligned points from
// their true positions.
// If TILEFLIGHT_ICP_TASK names a folder (source.ply, true.ply, voxels.ply, surface.ply, mesh.glb, as written by
// registration_peers.py), that task is used instead.
#include <benchmark/benchmark.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <optional>
#include <random>
#include <string>

#include "tests/height_field.h"
#include "tileflight/core/alignment/icp.h"
#include "tileflight/core/alignment/umeyama.h"
#include "tileflight/core/geometry/cloud_files.h"
#include "tileflight/core/geometry/nearest.h"
#include "tileflight/world/ground_truth/mesh_glb.h"
#include "tileflight/world/ground_truth/voxelize.h"

namespace {

using tileflight::alignment::IcpMethod;
using tileflight::alignment::IcpOptions;
using tileflight::alignment::IcpResult;
using tileflight::alignment::ScaleMode;
using tileflight::geometry::PointCloud;
using tileflight::geometry::Sim3;
using tileflight::geometry::TriangleIndex;
using tileflight::geometry::TriangleMesh;
using tileflight::geometry::Vec3;

constexpr std::size_t kPoints = 84029;
constexpr std::size_t kSurfacePoints = 500000;
constexpr double kSide_m = 250.0;
constexpr std::uint32_t kCells = 500;

/// A ravine with terraces and blocks on it.
double height_m(double x, double y) {
  double z =
      24.0 + 14.0 * std::tanh(0.04 * (x - 125.0 + 25.0 * std::sin(0.03 * y))) + 1.5 * std::sin(0.15 * x + 0.1 * y);
  const double block_x = std::fmod(x, 31.0), block_y = std::fmod(y, 27.0);
  if (block_x > 8.0 && block_x < 18.0 && block_y > 6.0 && block_y < 17.0)
    z += 3.0 + 0.04 * std::floor(x / 31.0) * std::floor(y / 27.0);
  return z;
}

/// Samples uniform by area, with the triangles' normals.
PointCloud make_surface(const TriangleMesh& mesh, std::size_t n, double noise_m) {
  std::mt19937_64 random(1);
  std::normal_distribution<double> noise(0.0, noise_m);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  std::vector<double> area;
  double sum = 0.0;
  for (const auto& [a, b, c] : mesh.triangles) {
    const Vec3& o = mesh.vertices[a];
    area.push_back(sum += (mesh.vertices[b] - o).cross(mesh.vertices[c] - o).norm());
  }
  PointCloud cloud;
  for (std::size_t k = 0; k < n; ++k) {
    const auto hit = std::lower_bound(area.begin(), area.end(), unit(random) * sum) - area.begin();
    const auto& [a, b, c] = mesh.triangles[static_cast<std::size_t>(hit)];
    double u = unit(random), v = unit(random);
    if (u + v > 1.0) {
      u = 1.0 - u;
      v = 1.0 - v;
    }
    const Vec3 e = mesh.vertices[b] - mesh.vertices[a], f = mesh.vertices[c] - mesh.vertices[a];
    cloud.positions.push_back(mesh.vertices[a] + u * e + v * f + Vec3(noise(random), noise(random), noise(random)));
    cloud.normals.push_back(e.cross(f).normalized().cast<float>());
  }
  return cloud;
}

struct Task {
  TriangleMesh mesh = tileflight::tests::height_field(kCells, 0.0, kSide_m, height_m);
  PointCloud voxel_centers = tileflight::geometry::cell_centers(
      tileflight::ground_truth::voxelize(mesh, {Vec3(0, 0, 0), Vec3(kSide_m, kSide_m, 60)}, 1.0));
  PointCloud surface = make_surface(mesh, kSurfacePoints, 0.0);
  PointCloud truth = make_surface(mesh, kPoints, 0.3);
  PointCloud source;

  explicit Task(const std::string& folder)
      : mesh(tileflight::ground_truth::read_mesh_glb(folder + "/mesh.glb")),
        voxel_centers(tileflight::geometry::read_cloud(folder + "/voxels.ply")),
        surface(tileflight::geometry::read_cloud(folder + "/surface.ply")),
        truth(tileflight::geometry::read_cloud(folder + "/true.ply")),
        source(tileflight::geometry::read_cloud(folder + "/source.ply")) {
    surface.normals.clear();  // estimated, as by the peers
  }

  Task() {
    const double angle_rad = 2.0 * std::acos(-1.0) / 180.0;
    const auto rotation = tileflight::geometry::so3_exp(Vec3(0.3, -0.4, 0.866).normalized() * angle_rad);
    const Vec3 center(125.0, 125.0, 25.0);
    source = transformed(Sim3(1.0, rotation, center - rotation * center + Vec3(0.6, -0.5, 0.3)), truth);
  }

  double error_m(const Sim3& T) const {
    double sum = 0.0;
    for (std::size_t i = 0; i < source.size(); ++i) sum += (T * source.positions[i] - truth.positions[i]).squaredNorm();
    return std::sqrt(sum / static_cast<double>(source.size()));
  }
};

const Task& task() {
  const char* folder = std::getenv("TILEFLIGHT_ICP_TASK");
  static const Task made = folder ? Task(folder) : Task();
  return made;
}

void report(benchmark::State& state, const IcpResult& result) {
  state.counters["error_m"] = task().error_m(result.T_target_source);
  state.counters["iterations"] = result.iterations;
  state.counters["converged"] = result.converged;
}

IcpOptions rigid(IcpOptions options, IcpMethod method) {
  options.method = method;
  options.scale = ScaleMode::kFixed;
  return options;
}

void to_cloud(benchmark::State& state, const PointCloud& target, const IcpOptions& options) {
  IcpResult result;
  for (auto _ : state) result = icp(task().source, target, Sim3(), options);
  report(state, result);
}

void icp_paper_settings(benchmark::State& state) {
  to_cloud(state, task().voxel_centers, rigid({}, IcpMethod::kPointToPoint));
}

void icp_to_voxel_centers(benchmark::State& state) {
  to_cloud(state, task().voxel_centers,
           rigid(tileflight::alignment::converging_icp_options(), IcpMethod::kPointToPoint));
}

/// Textbook ICP on both cores: a search for every point in every iteration, no acceleration, the same stopping
/// criterion (step below 1e-4 m).
void icp_textbook_to_voxel_centers(benchmark::State& state) {
  Sim3 T;
  int iterations = 0;
  for (auto _ : state) {
    const tileflight::geometry::NearestIndex index(task().voxel_centers.positions);
    T = Sim3();
    double step_m = 1.0;
    for (iterations = 0; step_m > 1e-4 && iterations < 1500; ++iterations) {
      std::vector<std::optional<tileflight::geometry::Neighbor>> nearest(task().source.size());
      tbb::parallel_for(std::size_t{0}, nearest.size(),
                        [&](std::size_t i) { nearest[i] = index.nearest(T * task().source.positions[i], 1.0); });
      std::vector<Vec3> from, to;
      for (std::size_t i = 0; i < nearest.size(); ++i) {
        if (!nearest[i]) continue;
        from.push_back(task().source.positions[i]);
        to.push_back(task().voxel_centers.positions[nearest[i]->index]);
      }
      const Sim3 next = tileflight::alignment::umeyama(from, to, ScaleMode::kFixed).T_target_source;
      double squares = 0.0;
      for (const Vec3& p : task().source.positions) squares += (next * p - T * p).squaredNorm();
      step_m = std::sqrt(squares / static_cast<double>(nearest.size()));
      T = next;
    }
  }
  state.counters["error_m"] = task().error_m(T);
  state.counters["iterations"] = iterations;
}

void icp_to_surface_points(benchmark::State& state) {
  to_cloud(state, task().surface, rigid(tileflight::alignment::converging_icp_options(), IcpMethod::kPointToPlane));
}

void icp_generalized_to_surface_points(benchmark::State& state) {
  to_cloud(state, task().surface, rigid(tileflight::alignment::converging_icp_options(), IcpMethod::kGeneralized));
}

void icp_to_mesh(benchmark::State& state) {
  IcpResult result;
  for (auto _ : state) {
    const TriangleIndex index(task().mesh);
    result = icp(task().source, index, task().mesh, Sim3(),
                 rigid(tileflight::alignment::converging_icp_options(), IcpMethod::kPointToMesh));
  }
  report(state, result);
}

}  // namespace

BENCHMARK(icp_paper_settings)->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK(icp_to_voxel_centers)->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK(icp_textbook_to_voxel_centers)->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK(icp_to_surface_points)->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK(icp_generalized_to_surface_points)->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK(icp_to_mesh)->Unit(benchmark::kMillisecond)->UseRealTime();
