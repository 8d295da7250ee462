#include "tileflight/live/simulator/voxel_files.h"

#include <algorithm>
#include <cmath>
#include <fstream>

#include "tileflight/core/base/input_error.h"
#include "tileflight/world/ground_truth/voxelize.h"

namespace tileflight::simulator {
namespace {

using geometry::Box3;
using geometry::Vec3;

constexpr double kMaxSide_m = 1e5;
constexpr double kMaxOccupied = 5e7;  // 12 bytes per cell
constexpr double kCellsAnArea = 3.0;  ///< touched by a surface as large as a cell's face, at most about

VoxelGridSpec checked_grid(const Vec3& center_local, const Vec3& size_m, double edge_m, std::int64_t max_cells) {
  if (!center_local.allFinite() || center_local.cwiseAbs().maxCoeff() > 1e7)
    throw InputError("voxel grid", "its centre is not finite or too far away");
  if (!(edge_m >= 1e-3 && edge_m <= kMaxSide_m))
    throw InputError("voxel grid", "the resolution must be at least 0.001 m");
  if (!size_m.allFinite() || size_m.minCoeff() < 0.0 || size_m.maxCoeff() > kMaxSide_m)
    throw InputError("voxel grid", "its edges must be from 0 to 100000 m");
  VoxelGridSpec grid{center_local, size_m, edge_m, {}, {}};
  double product = 1.0;
  for (int axis = 0; axis < 3; ++axis) {
    grid.cells[static_cast<std::size_t>(axis)] = std::llround(size_m[axis] / edge_m);
    product *= static_cast<double>(grid.cells[static_cast<std::size_t>(axis)]);
  }
  if (product < 1.0) throw InputError("voxel grid", "no cell of this resolution fits into the box");
  if (product > static_cast<double>(max_cells))
    throw InputError("voxel grid", "more than " + std::to_string(max_cells) + " cells; request fewer or larger ones");
  return grid;
}

void set_box(VoxelGridSpec& grid, const Vec3& low) {
  const Vec3 cells(static_cast<double>(grid.cells[0]), static_cast<double>(grid.cells[1]),
                   static_cast<double>(grid.cells[2]));
  grid.box = Box3(low, low + grid.voxel_size_m * cells);
}

/// The triangles that may touch the box, and their approximate area inside it.
geometry::TriangleMesh triangles_near_box(const geometry::TriangleMesh& mesh, const Box3& box, double& area_m2) {
  geometry::TriangleMesh near;
  for (const geometry::Triangle& t : mesh.triangles) {
    Box3 own;
    for (const std::uint32_t corner : t) own.extend(mesh.vertices[corner]);
    const Box3 shared = own.intersection(box);
    if (!own.intersects(box)) continue;
    const auto first = static_cast<std::uint32_t>(near.vertices.size());
    for (const std::uint32_t corner : t) near.vertices.push_back(mesh.vertices[corner]);
    near.triangles.push_back({first, first + 1, first + 2});
    const Vec3& a = mesh.vertices[t[0]];
    const double area = 0.5 * (mesh.vertices[t[1]] - a).cross(mesh.vertices[t[2]] - a).norm();
    const Vec3 s = shared.sizes();
    area_m2 += std::min(area, s.x() * s.y() + s.y() * s.z() + s.z() * s.x());
  }
  return near;
}

/// Writes run-length pairs (value, count) of cells whose indices are added in order.
class RunLengthWriter {
 public:
  explicit RunLengthWriter(std::ostream& out) : out_(out) {}

  void occupied_at(std::int64_t index) {
    if (index > end_) {
      flush();
      write(0, index - end_);
      end_ = begin_ = index;
    }
    ++end_;
  }
  void finish(std::int64_t count) {
    flush();
    write(0, count - end_);
  }

 private:
  void flush() {
    write(1, end_ - begin_);
    begin_ = end_;
  }
  void write(char value, std::int64_t count) {
    for (; count > 0; count -= 255) {
      out_.put(value);
      out_.put(static_cast<char>(std::min<std::int64_t>(count, 255)));
    }
  }

  std::ostream& out_;
  std::int64_t begin_ = 0, end_ = 0;  ///< current occupied run
};

}  // namespace

VoxelGridSpec make_airsim_grid(const Vec3& center_local, const Vec3& size_m, double edge_m, std::int64_t max_cells) {
  VoxelGridSpec grid = checked_grid(center_local, size_m, edge_m, max_cells);
  const Vec3 halves(static_cast<double>(grid.cells[0] / 2), static_cast<double>(grid.cells[1] / 2),
                    static_cast<double>(grid.cells[2] / 2));
  set_box(grid, center_local - edge_m * (halves + Vec3::Constant(0.5)));
  return grid;
}

VoxelGridSpec make_centered_grid(const Vec3& center_local, const Vec3& size_m, double edge_m, std::int64_t max_cells) {
  VoxelGridSpec grid = checked_grid(center_local, size_m, edge_m, max_cells);
  const Vec3 cells(static_cast<double>(grid.cells[0]), static_cast<double>(grid.cells[1]),
                   static_cast<double>(grid.cells[2]));
  set_box(grid, center_local - 0.5 * edge_m * cells);
  return grid;
}

geometry::VoxelGrid voxelize_grid(const geometry::TriangleMesh& mesh, const VoxelGridSpec& grid) {
  double area_m2 = 0.0;
  const geometry::TriangleMesh near = triangles_near_box(mesh, grid.box, area_m2);
  const double likely = std::min(static_cast<double>(grid.count()),
                                 kCellsAnArea * area_m2 / (grid.voxel_size_m * grid.voxel_size_m) + 1.0);
  if (likely > kMaxOccupied)
    throw InputError("voxel grid", "too many cells would be occupied; request a smaller box or larger cells");
  if (near.triangles.empty()) {
    const auto side = [&](std::size_t axis) { return static_cast<std::int32_t>(grid.cells[axis]); };
    return {grid.box.min(), grid.voxel_size_m, {side(0), side(1), side(2)}, {}};
  }
  return ground_truth::voxelize(near, grid.box, grid.voxel_size_m);
}

bool write_airsim_binvox(const std::filesystem::path& file, const geometry::VoxelGrid& grid, const VoxelGridSpec& spec,
                         bool inverted_scale) {
  const auto [east, north, up] = spec.cells;
  std::vector<std::int64_t> order;
  order.reserve(grid.occupied.size());
  for (const geometry::Cell& cell : grid.occupied) order.push_back(cell.y + north * (cell.z + up * cell.x));
  std::ranges::sort(order);
  std::ofstream out(file, std::ios::binary);
  if (!out) return false;
  const Vec3& size = spec.size_m;  // east, north, up
  out << "#binvox 1\ndim " << north << ' ' << up << ' ' << east << "\ntranslate " << -size.y() / 2 << ' '
      << -size.x() / 2 << ' ' << -size.z() / 2 << "\nscale " << (inverted_scale ? 1.0 / size.y() : size.y())
      << "\ndata\n";
  RunLengthWriter runs(out);
  for (const std::int64_t index : order) runs.occupied_at(index);
  runs.finish(spec.count());
  out.flush();
  return out.good();
}

VoxelGridData to_voxel_grid_data(const geometry::VoxelGrid& grid, const VoxelGridSpec& spec,
                                 const geometry::SE3& T_local_ned) {
  const auto [east, north, up] = spec.cells;
  VoxelGridData data;
  data.dims = {static_cast<int>(north), static_cast<int>(east), static_cast<int>(up)};
  const Vec3 low = spec.box.min(), high = spec.box.max();
  const Vec3 corner = T_local_ned.inverse() * Vec3(low.x(), low.y(), high.z());
  data.origin = {static_cast<float>(corner.x()), static_cast<float>(corner.y()), static_cast<float>(corner.z())};
  data.resolution = static_cast<float>(spec.voxel_size_m);
  data.occupied.assign(static_cast<std::size_t>(spec.count()), 0);
  for (const geometry::Cell& cell : grid.occupied) {
    const std::int64_t index = (cell.y * east + cell.x) * up + (up - 1 - cell.z);
    data.occupied[static_cast<std::size_t>(index)] = 1;
  }
  data.occupied_count = grid.occupied.size();
  return data;
}

}  // namespace tileflight::simulator
