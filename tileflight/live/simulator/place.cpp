#include "tileflight/live/simulator/place.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/geometry/mesh.h"
#include "tileflight/core/geometry/voxel_grid.h"
#include "tileflight/live/simulator/airsim_types.h"
#include "tileflight/live/simulator/frames.h"
#include "tileflight/live/simulator/world.h"
#include "tileflight/world/ground_truth/ground_truth.h"
#include "tileflight/world/ground_truth/voxelize.h"
#include "tileflight/world/place/extract.h"

namespace tileflight::simulator {
namespace {

using geometry::Box3;
using geometry::SE3;
using geometry::Vec3;

/// A checked box of cells requested by a client. Local frame (east, north, up).
struct VoxelGridSpec {
  geometry::Vec3 center_local = geometry::Vec3::Zero();
  geometry::Vec3 size_m = geometry::Vec3::Ones();  ///< east, north, up
  double voxel_size_m = 1.0;
  std::array<std::int64_t, 3> cells{1, 1, 1};  ///< east, north, up: size over edge length, rounded
  geometry::Box3 box;                          ///< bounds of all cells

  std::int64_t count() const { return cells[0] * cells[1] * cells[2]; }
};

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

/// A grid in AirSim's layout: the centre is the centre of cell n/2 (integer division) along each axis. Throws
/// InputError: not finite, no cell, sides over 100 km, more than `max_cells`.
VoxelGridSpec make_airsim_grid(const Vec3& center_local, const Vec3& size_m, double edge_m, std::int64_t max_cells) {
  VoxelGridSpec grid = checked_grid(center_local, size_m, edge_m, max_cells);
  const Vec3 halves(static_cast<double>(grid.cells[0] / 2), static_cast<double>(grid.cells[1] / 2),
                    static_cast<double>(grid.cells[2] / 2));
  set_box(grid, center_local - edge_m * (halves + Vec3::Constant(0.5)));
  return grid;
}

/// A grid whose centre is the centre of the box.
VoxelGridSpec make_centered_grid(const Vec3& center_local, const Vec3& size_m, double edge_m, std::int64_t max_cells) {
  VoxelGridSpec grid = checked_grid(center_local, size_m, edge_m, max_cells);
  const Vec3 cells(static_cast<double>(grid.cells[0]), static_cast<double>(grid.cells[1]),
                   static_cast<double>(grid.cells[2]));
  set_box(grid, center_local - 0.5 * edge_m * cells);
  return grid;
}

/// Cells touched by a triangle. Throws InputError if the grid would need too much memory.
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

/// Writes a binvox file in AirSim's layout: `dim` is the number of cells to the north, up and east; data with north
/// fastest, then up, east slowest; `translate` is minus half the extents north, east, up; `scale` is the northern
/// extent in metres, or with `inverted_scale` its reciprocal, as AirSim writes it. Returns false if the file cannot be
/// written.
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

/// Converts to an array ordered north, east, down.
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

constexpr std::int64_t kMaxFileCells = std::int64_t{1} << 34;
constexpr std::int64_t kMaxAnswerCells = std::int64_t{32} << 20;
constexpr double kMaxRegionSize_m = 20000.0;
constexpr double kSurfaceTolerance_m = 0.05;  // a point on the surface is not occluded by it

/// A client's box in NED axes, converted to the local frame.
Box3 to_local_box(const SE3& T_local_ned, const Vector3r& center, const Vector3r& size, const char* call) {
  const Vec3 edges = checked_position(size, call);
  if (edges.minCoeff() <= 0.0 || edges.maxCoeff() > kMaxRegionSize_m)
    throw InputError(call, "the region's edges must be above 0 and at most 20000 m");
  const Vec3 middle = T_local_ned * checked_position(center, call);
  const Vec3 half = 0.5 * Vec3(edges.y(), edges.x(), edges.z());
  return {middle - half, middle + half};
}

double checked_error(float error_m, const char* call) {
  if (!(error_m >= 0.0F && error_m <= 1e6F)) throw InputError(call, "the geometric error must be 0 m or more");
  return error_m;
}

bool has_line_of_sight(const scene::Scene& scene, const Vec3& from, const Vec3& to) {
  const Vec3 way = to - from;
  const double length_m = way.norm() - kSurfaceTolerance_m;
  return length_m <= kSurfaceTolerance_m ||
         !scene.is_occluded({from + kSurfaceTolerance_m * way.normalized(), way.normalized()},
                            length_m - kSurfaceTolerance_m);
}

}  // namespace

bool Place::create_voxel_grid(const Vector3r& position, int x, int y, int z, float resolution,
                              const std::string& file) {
  const Vec3 center = world_.T_local_ned * checked_position(position, "simCreateVoxelGrid");
  const VoxelGridSpec spec = make_airsim_grid(center, Vec3(y, x, z), resolution, kMaxFileCells);
  std::filesystem::path path;
  try {
    path = world_.file_access.resolve_writable(file);
  } catch (const std::runtime_error& error) {
    world_.log_line("simCreateVoxelGrid: " + std::string(error.what()));
    return false;  // AirSim's answer where it cannot write
  }
  const geometry::VoxelGrid grid = voxelize_grid(world_.working_set.triangles_in(spec.box, 0.0), spec);
  return write_airsim_binvox(path, grid, spec, world_.settings.inverted_voxel_scale);
}

VoxelGridData Place::voxel_grid(const Vector3r& center, const Vector3r& size, float resolution) {
  const Vec3 edges = to_vec3(size);
  const VoxelGridSpec spec = make_centered_grid(world_.T_local_ned * checked_position(center, "tfCreateVoxelGrid"),
                                                Vec3(edges.y(), edges.x(), edges.z()), resolution, kMaxAnswerCells);
  return to_voxel_grid_data(voxelize_grid(world_.working_set.triangles_in(spec.box, 0.0), spec), spec,
                            world_.T_local_ned);
}

bool Place::test_line_of_sight_to_point(const GeoPoint& point, const std::string& vehicle) {
  const Vec3 to = world_.T_local_ned * world_.geodetic_frame.to_ned(point);
  Vec3 from = Vec3::Zero();
  {
    const std::lock_guard lock(world_.state_mutex);
    from = world_.slot(vehicle).vehicle->position_local();
  }
  return has_line_of_sight(world_.place_now()->scene(), from, to);
}

bool Place::test_line_of_sight_between_points(const GeoPoint& from, const GeoPoint& to) {
  return has_line_of_sight(world_.place_now()->scene(), world_.T_local_ned * world_.geodetic_frame.to_ned(from),
                           world_.T_local_ned * world_.geodetic_frame.to_ned(to));
}

std::vector<GeoPoint> Place::get_world_extents() {
  const Box3 box = world_.working_set.bounds();
  const SE3 T_ned_local = world_.T_local_ned.inverse();
  return {world_.geodetic_frame.to_geo_point(T_ned_local * box.min()),
          world_.geodetic_frame.to_geo_point(T_ned_local * box.max())};
}

LoadedRegion Place::load_region(const Vector3r& center, const Vector3r& size, float error_m) {
  const Box3 box = to_local_box(world_.T_local_ned, center, size, "tfLoadRegion");
  const double error = checked_error(error_m, "tfLoadRegion");
  std::vector<SensorViewpoint> viewpoints;
  {
    const std::lock_guard lock(world_.state_mutex);
    viewpoints = world_.viewpoints();
  }
  return world_.working_set.add_region(box, error, viewpoints);
}

GroundTruthReport Place::ground_truth(const Vector3r& center, const Vector3r& size, float error_m, float voxel_m,
                                      const std::string& folder) {
  const char* call = "tfGroundTruth";
  const Box3 box = to_local_box(world_.T_local_ned, center, size, call);
  const double error = checked_error(error_m, call);
  make_airsim_grid(box.center(), box.sizes(), voxel_m, kMaxFileCells);  // checks the same limits for the cells
  const std::filesystem::path path = world_.file_access.resolve_writable(folder);
  if (world_.options.source.empty()) {
    const auto meshes = world_.working_set.current()->scene().parts().front()->meshes();
    ground_truth::write_ground_truth(meshes, box, {.voxel_m = voxel_m}, path);
    return {path.string(), "{}"};
  }
  place::ExtractSettings settings{world_.options.source, world_.options.load, voxel_m};
  settings.load.center.reset();
  settings.load.areas.clear();
  settings.load.flight.reset();
  settings.load.error_m = error;
  settings.load.size = box.sizes();
  settings.load.max_memory_bytes = world_.options.max_memory_bytes;
  settings.load.center_local = box.center();
  if (world_.working_set.local_frame()) settings.load.origin = world_.working_set.local_frame()->origin();
  return {path.string(), to_json(place::extract(settings, path, true)).dump()};
}

}  // namespace tileflight::simulator
