#include "tileflight/world/ground_truth/voxelize.h"

#include <tbb/blocked_range.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_reduce.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <mutex>
#include <optional>
#include <sstream>
#include <string>

#include "tileflight/core/base/input_error.h"
#include "tileflight/world/ground_truth/brick_map.h"
#include "tileflight/world/ground_truth/triangle_cells.h"

namespace tileflight::ground_truth {

namespace {

using geometry::Box3;
using geometry::TriangleMesh;
using geometry::Vec3;

/// Upper limit of occupied cells: the list of them alone takes 6 GB.
constexpr double kMaxCells = 5e8;

/// Triangles between two calls of Progress.
constexpr std::size_t kBlock = 8192;

}  // namespace

std::array<std::int32_t, 3> grid_dims(const Box3& box, double edge_m) {
  if (!std::isfinite(edge_m) || edge_m <= 0.0) {
    throw InputError("voxel edge " + std::to_string(edge_m), "must be a length above zero, in metres");
  }
  const bool finite = box.min().allFinite() && box.max().allFinite();
  if (!finite || !((box.max() - box.min()).minCoeff() > 0.0)) {
    throw InputError("region", "is empty or not finite: give a box with sides above zero");
  }
  std::array<std::int32_t, 3> dims{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    // Cells cover the whole box: a place's own box may end with a roof a millimetre above its last whole metre. 9 / 0.3
    // must give 30 cells all the same.
    constexpr double kRounding = 1e-6;
    const double cells = std::max(1.0, std::ceil(box.sizes()[static_cast<int>(axis)] / edge_m - kRounding));
    if (cells > BrickMap::kMaxCellsPerAxis) {
      throw InputError("voxel edge " + std::to_string(edge_m) + " m",
                       "gives " + std::to_string(static_cast<std::int64_t>(cells)) +
                           " cells along one axis, more than " + std::to_string(BrickMap::kMaxCellsPerAxis) +
                           ": choose a larger edge");
    }
    dims[axis] = static_cast<std::int32_t>(cells);
  }
  return dims;
}

namespace {

/// Conversion from metres to cells.
class CellFrame {
 public:
  CellFrame(const TriangleMesh& mesh, const Vec3& origin, double edge_m)
      : mesh_(mesh), origin_(origin), cells_per_m_(1.0 / edge_m) {}

  /// Throws InputError when a corner is not finite.
  CellTriangle triangle(std::size_t i) const {
    CellTriangle t;
    double sum = 0.0;
    for (std::size_t k = 0; k < 3; ++k) {
      t[k] = (mesh_.vertices[mesh_.triangles[i][k]] - origin_) * cells_per_m_;
      sum += t[k].x() + t[k].y() + t[k].z();
    }
    if (!std::isfinite(sum)) throw InputError("triangle " + std::to_string(i), "a corner is not finite");
    return t;
  }

 private:
  const TriangleMesh& mesh_;
  Vec3 origin_;
  double cells_per_m_;
};

/// Estimate of the number of cells touched by a triangle: the area of its largest projection plus its sides, at most
/// the window's columns below it. Triangles of a few cells count as zero: their memory is bounded by the mesh.
double estimate_cells(const CellTriangle& t, const std::array<std::int32_t, 3>& dims, const CellRange& window) {
  const CellRange range = intersection(clip_to_grid(bounding_cells(t, dims), dims), window);
  if (range.empty()) return 0.0;
  const Vec3 counts(static_cast<double>(range.count(0)), static_cast<double>(range.count(1)),
                    static_cast<double>(range.count(2)));
  const double columns = counts.prod() / counts.minCoeff();
  if (columns < 256.0) return 0.0;
  const Vec3 ab = t[1] - t[0];
  const Vec3 ac = t[2] - t[0];
  return std::min(columns, 0.5 * ab.cross(ac).lpNorm<Eigen::Infinity>() + ab.norm() + ac.norm());
}

void require_few_cells(const CellFrame& frame, std::size_t triangles, const std::array<std::int32_t, 3>& dims,
                       const CellRange& window, double edge_m) {
  const double cells = tbb::parallel_reduce(
      tbb::blocked_range<std::size_t>(0, triangles, kBlock), 0.0,
      [&](const tbb::blocked_range<std::size_t>& range, double sum) {
        for (std::size_t i = range.begin(); i < range.end(); ++i)
          sum += estimate_cells(frame.triangle(i), dims, window);
        return sum;
      },
      std::plus<>());
  if (cells > kMaxCells) {
    throw InputError("voxel edge " + std::to_string(edge_m) + " m",
                     "would occupy about " + std::to_string(static_cast<std::int64_t>(cells)) +
                         " cells, more than the " + std::to_string(static_cast<std::int64_t>(kMaxCells)) +
                         " supported: choose a larger edge or a smaller region");
  }
}

}  // namespace

geometry::VoxelGrid voxelize(const TriangleMesh& mesh, const Box3& box, double edge_m, const Progress& progress) {
  return voxelize(mesh, box, edge_m, whole_grid(grid_dims(box, edge_m)), progress);
}

geometry::VoxelGrid voxelize(const TriangleMesh& mesh, const Box3& box, double edge_m, const CellRange& window,
                             const Progress& progress) {
  const std::array<std::int32_t, 3> dims = grid_dims(box, edge_m);
  const CellFrame frame(mesh, box.min(), edge_m);
  const std::size_t triangles = mesh.triangles.size();
  require_few_cells(frame, triangles, dims, window, edge_m);

  // Each thread collects its own set; a union has no order, so the result does not depend on the distribution of
  // triangles over threads.
  tbb::enumerable_thread_specific<BrickMap> sets;
  std::mutex progress_mutex;
  std::int64_t done = 0;
  const auto voxelize_block = [&](const tbb::blocked_range<std::size_t>& range) {
    BrickMap& set = sets.local();
    const auto insert = [&set](const std::array<std::int32_t, 3>& cell, std::size_t axis, std::int32_t last) {
      set.insert_run(cell, axis, last);
    };
    for (std::size_t i = range.begin(); i < range.end(); ++i)
      visit_touched_cells(frame.triangle(i), dims, window, insert);
    if (!progress) return;
    const std::lock_guard lock(progress_mutex);
    done += static_cast<std::int64_t>(range.size());
    progress(done, static_cast<std::int64_t>(triangles), "voxels");
  };
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, triangles, kBlock), voxelize_block, tbb::simple_partitioner());

  BrickMap all;
  for (BrickMap& set : sets) {
    if (set.brick_count() > all.brick_count()) std::swap(all, set);
    all.merge(set);
  }
  return {box.min(), edge_m, dims, all.sorted_cells()};
}

namespace {

using geometry::Cell;
using geometry::Vec3;
using geometry::VoxelGrid;

std::optional<Cell> cell_of(const Vec3& point, const VoxelGrid& grid) {
  const Vec3 in_cells = (point - grid.origin) / grid.edge_m;
  std::array<std::int32_t, 3> index{};
  for (std::size_t i = 0; i < 3; ++i) {
    const double at = in_cells[static_cast<Eigen::Index>(i)];
    if (!(at >= 0 && at <= grid.dims[i])) return std::nullopt;
    index[i] = std::min(static_cast<std::int32_t>(std::floor(at)), grid.dims[i] - 1);
  }
  return Cell{index[0], index[1], index[2]};
}

}  // namespace

geometry::Cell nearest_cell(const geometry::Vec3& position, const VoxelGrid& grid) {
  const Vec3 in_cells = (position - grid.origin) / grid.edge_m;
  std::array<std::int32_t, 3> index{};
  for (std::size_t i = 0; i < 3; ++i) {
    const double at = std::floor(in_cells[static_cast<Eigen::Index>(i)]);
    index[i] = static_cast<std::int32_t>(std::clamp(at, 0.0, grid.dims[i] - 1.0));
  }
  return {index[0], index[1], index[2]};
}

geometry::PointCloud points_in_box(const std::vector<geometry::PointCloud>& clouds, const geometry::Box3& box) {
  geometry::PointCloud out;
  for (const geometry::PointCloud& cloud : clouds) {
    for (std::size_t i = 0; i < cloud.size(); ++i) {
      if (!box.contains(cloud.positions[i])) continue;
      out.positions.push_back(cloud.positions[i]);
      out.normals.push_back(cloud.normals.empty() ? Eigen::Vector3f(0, 0, 0) : cloud.normals[i]);
    }
  }
  return out;
}

void mark_occupied(const geometry::PointCloud& points, VoxelGrid& grid) {
  for (const Vec3& point : points.positions) {
    if (const std::optional<Cell> cell = cell_of(point, grid)) grid.occupied.push_back(*cell);
  }
  std::sort(grid.occupied.begin(), grid.occupied.end());
  grid.occupied.erase(std::unique(grid.occupied.begin(), grid.occupied.end()), grid.occupied.end());
}

namespace {

constexpr double kPublishedEdge_m = 1.0, kPublishedCells = 250.0;
constexpr double kFewCells = 50.0;
constexpr double kMinEdge_m = 0.001;

std::string rounded(double metres) {
  std::ostringstream text;
  text.precision(metres < 1 ? 1 : metres < 10 ? 2 : metres < 100 ? 3 : 4);
  text << metres;
  return text.str();
}

}  // namespace

double suggest_voxel_m(const geometry::Vec3& extent_m) {
  const double target_m = std::clamp(extent_m.maxCoeff() / kPublishedCells, kMinEdge_m, kPublishedEdge_m);
  const double power = std::pow(10.0, std::floor(std::log10(target_m)));
  double nearest_m = power;
  for (const double factor : {1.0, 2.0, 5.0, 10.0}) {
    const auto off = [&](double edge_m) { return std::abs(std::log(edge_m / target_m)); };
    if (off(factor * power) < off(nearest_m)) nearest_m = factor * power;
  }
  return std::min(nearest_m, kPublishedEdge_m);
}

std::optional<std::string> coarse_voxel_warning(const geometry::Vec3& extent_m, double voxel_m) {
  if (!(extent_m.maxCoeff() > 0) || extent_m.maxCoeff() >= kFewCells * voxel_m) return std::nullopt;
  return "voxels of " + rounded(voxel_m) + " m are coarse for a surface of " + rounded(extent_m.x()) + " x " +
         rounded(extent_m.y()) + " x " + rounded(extent_m.z()) + " m: errors below half a voxel hardly show in the " +
         "distance to their centres; use --voxel " + rounded(suggest_voxel_m(extent_m));
}

}  // namespace tileflight::ground_truth
