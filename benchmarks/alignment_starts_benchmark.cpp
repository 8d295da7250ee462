// Convergence range of map alignment. A known transform is disturbed about the map's centre by random rotations,
// translations and scales; the benchmark counts the starts that end within 0.1 m, 0.1 degrees and 0.2 % of the result
// of the undisturbed start. This is not a timing of a fixed task: it needs the results of a run.
//
//   alignment_starts_benchmark RUN/real/odometry/map.ply RUN/truth RUN/real/transform.json [N] [SETTINGS] [bound]
//
// SETTINGS: default (the steps of align_map, then the paper's to voxel centres), surface (the same, but with the last
// step to the surface), paper (the paper's settings alone). Starts are drawn with errors of up to 10 m, 15 degrees and
// 20 %, or with `bound` exactly these.
#include <sys/resource.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <random>
#include <string>

#include "tileflight/core/alignment/align_map.h"
#include "tileflight/core/alignment/transform_file.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/geometry/cloud_files.h"
#include "tileflight/world/ground_truth/mesh_glb.h"

namespace {

using namespace tileflight;
using alignment::AlignMapOptions;
using alignment::MapAlignment;
using geometry::Sim3;
using geometry::Vec3;

constexpr double kDegree_rad = 0.017453292519943295;

double cpu_s() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_utime.tv_sec) + 1e-6 * static_cast<double>(usage.ru_utime.tv_usec);
}

struct Place {
  geometry::PointCloud map, cells;
  geometry::TriangleMesh mesh;
  geometry::TriangleIndex index;
  Sim3 T_local_map;
  Vec3 center_local = Vec3::Zero();

  Place(const std::string& map_file, const std::string& truth, const std::string& transform)
      : map(geometry::read_cloud(map_file)),
        cells(geometry::read_cloud(truth + "/voxels.ply")),
        mesh(ground_truth::read_mesh_glb(truth + "/mesh.glb")),
        index(mesh),
        T_local_map(alignment::read_transform(transform).T_target_source) {
    std::size_t inside = 0;
    for (const Vec3& p : map.positions) {
      if (!column().contains(T_local_map * p)) continue;
      center_local += T_local_map * p;
      ++inside;
    }
    if (inside > 0) center_local /= static_cast<double>(inside);
  }

  /// The ground truth's box extended vertically: points beside it have nothing to be aligned to.
  geometry::Box3 column() const {
    geometry::Box3 box = geometry::bounds(mesh);
    box.min().z() -= 1e6;
    box.max().z() += 1e6;
    return box;
  }
};

/// Difference between two transforms of the map.
struct Difference {
  double shift_m = 0.0, angle_deg = 0.0, scale = 0.0;
  bool small() const { return shift_m < 0.1 && angle_deg < 0.1 && scale < 0.002; }
};

Difference difference(const Sim3& A, const Sim3& B, const Vec3& center_local) {
  const Vec3 center_map = B.inverse() * center_local;
  return {(A * center_map - B * center_map).norm(), A.rotation.angularDistance(B.rotation) / kDegree_rad,
          std::abs(A.scale / B.scale - 1.0)};
}

/// Draws similarities about the map's centre.
class Disturbances {
 public:
  Disturbances(const Vec3& center, bool at_bound) : center_(center), at_bound_(at_bound) {}

  Sim3 next() {
    const Vec3 axis = direction(), shift = direction();
    const double angle_rad = 15.0 * kDegree_rad * size(), shift_m = 10.0 * size(), stretch = 0.2 * size();
    const double scale = unit_(random_) < 0.5 ? 1.0 - stretch : 1.0 + stretch;
    const auto rotation = geometry::so3_exp(angle_rad * axis);
    return {scale, rotation, center_ + shift_m * shift - scale * (rotation * center_)};
  }

 private:
  double size() { return at_bound_ ? 1.0 : unit_(random_); }
  Vec3 direction() { return Vec3(normal_(random_), normal_(random_), normal_(random_)).normalized(); }

  Vec3 center_;
  bool at_bound_;
  std::mt19937_64 random_{1};
  std::uniform_real_distribution<double> unit_{0.0, 1.0};
  std::normal_distribution<double> normal_{0.0, 1.0};
};

struct Count {
  int ended_there = 0, wrong_and_said = 0, wrong_and_unsaid = 0;
};

void run(const char* name, const Place& place, const AlignMapOptions& options, int starts, bool at_bound) {
  const alignment::AlignmentTarget target{&place.cells, &place.index, &place.mesh};
  const Sim3 expected = align_map(place.map, place.T_local_map, target, options).result.T_target_source;
  Disturbances disturbances(place.center_local, at_bound);
  Count count;
  const double begin_s = cpu_s();
  for (int k = 0; k < starts; ++k) {
    const Sim3 off = disturbances.next();
    const alignment::IcpResult end = align_map(place.map, off * place.T_local_map, target, options).result;
    const Difference d = difference(end.T_target_source, expected, place.center_local);
    if (d.small()) {
      ++count.ended_there;
      continue;
    }
    ++(end.converged && end.note.empty() ? count.wrong_and_unsaid : count.wrong_and_said);
    std::printf("  start %3d (scale %.2f): %.2f m, %.2f deg, %.2f %% off; fitness %.3f, rmse %.3f m%s; %s\n", k,
                off.scale, d.shift_m, d.angle_deg, 100.0 * d.scale, end.fitness, end.rmse_m,
                end.converged ? "" : ", not converged", end.note.c_str());
  }
  std::printf("%-10s %d of %d starts ended there (%.1f %%), %d wrong and said so, %d wrong unsaid; %.2f s CPU each\n",
              name, count.ended_there, starts, 100.0 * count.ended_there / starts, count.wrong_and_said,
              count.wrong_and_unsaid, (cpu_s() - begin_s) / starts);
}

AlignMapOptions options_of(const std::string& settings) {
  AlignMapOptions options;
  if (settings == "default") return options;
  if (settings == "surface") {
    options.icp.method = alignment::IcpMethod::kPointToMesh;
    return options;
  }
  if (settings != "paper") throw InputError("settings", "must be default, surface or paper, not " + settings);
  return alignment::paper_options();
}

}  // namespace

int main(int argc, char** argv) try {
  if (argc < 4) {
    std::fprintf(stderr, "alignment_starts_benchmark MAP TRUTH-FOLDER TRANSFORM [N] [SETTINGS] [bound]\n");
    return 2;
  }
  const Place place(argv[1], argv[2], argv[3]);
  const int starts = argc > 4 ? std::atoi(argv[4]) : 40;
  const std::string settings = argc > 5 ? argv[5] : "default";
  AlignMapOptions options = options_of(settings);
  options.icp.regions = {place.column()};
  run(settings.c_str(), place, options, starts, argc > 6 && std::string(argv[6]) == "bound");
  return 0;
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
