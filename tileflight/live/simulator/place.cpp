#include "tileflight/live/simulator/place.h"

#include <nlohmann/json.hpp>
#include <stdexcept>

#include "tileflight/core/base/input_error.h"
#include "tileflight/live/simulator/frames.h"
#include "tileflight/live/simulator/voxel_files.h"
#include "tileflight/live/simulator/world.h"
#include "tileflight/world/ground_truth/ground_truth.h"
#include "tileflight/world/place/extract.h"

namespace tileflight::simulator {
namespace {

using geometry::Box3;
using geometry::SE3;
using geometry::Vec3;

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
  return {path.string(), place::extract(settings, path, true).dump()};
}

}  // namespace tileflight::simulator
