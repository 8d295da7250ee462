#include <algorithm>
#include <limits>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/text_fields.h"
#include "tileflight/live/simulator/frames.h"
#include "tileflight/live/simulator/object_names.h"
#include "tileflight/live/simulator/simulator_impl.h"
#include "tileflight/live/simulator/voxel_files.h"
#include "tileflight/tiles/tileset/view_criteria.h"
#include "tileflight/world/ground_truth/ground_truth.h"
#include "tileflight/world/place/extract.h"

namespace tileflight::simulator {
namespace {

using geometry::Box3;
using geometry::SE3;
using geometry::Vec3;

constexpr std::int64_t kMaxFileCells = std::int64_t{1} << 34;
constexpr std::int64_t kMaxAnswerCells = std::int64_t{32} << 20;
constexpr std::size_t kMaxMeshVertices = 20'000'000;
constexpr float kCentimetres = 100.0F;
constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();
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

std::vector<std::string> scene_object_names(Simulator::Impl& impl) { return impl.place_now()->distinct_names(); }

/// Centre of the bounds of the objects with this name, local frame.
std::optional<Vec3> find_object_center(const ResidentScene& place, const std::string& name) {
  if (!place.has_surface() || !std::ranges::binary_search(place.distinct_names(), name)) return std::nullopt;
  Box3 box;
  for (std::size_t i = 0; i < place.object_names().size(); ++i) {
    if (place.object_names()[i] == name) box.extend(place.object_bounds()[i]);
  }
  return box.center();
}

/// A mesh in Unreal's convention: centimetres, x north, y east, z up (left-handed), so the triangles' orientation is
/// reversed.
MeshPositionVertexBuffersResponse make_vertex_buffers(const imaging::TexturedMesh& mesh, const SE3& T_ned_local) {
  MeshPositionVertexBuffersResponse buffers;
  buffers.name = simulator::tile_name(mesh.name);
  for (const Vec3& vertex : mesh.mesh.vertices) {
    const Vector3r ned = to_airsim(T_ned_local * vertex);
    buffers.vertices.insert(buffers.vertices.end(),
                            {kCentimetres * ned.x_val, kCentimetres * ned.y_val, -kCentimetres * ned.z_val});
  }
  for (const geometry::Triangle& t : mesh.mesh.triangles)
    buffers.indices.insert(buffers.indices.end(), t.begin(), t.end());
  return buffers;
}

}  // namespace

std::vector<std::string> Simulator::sim_list_scene_objects(const std::string& name_regex) {
  const simulator::NamePattern pattern(name_regex, simulator::NamePattern::Case::kHeeded);
  std::vector<std::string> names = scene_object_names(*impl_);
  std::erase_if(names, [&](const std::string& name) { return !pattern.matches(name); });
  return names;
}

bool Simulator::sim_set_segmentation_object_id(const std::string& mesh_name, int object_id, bool is_name_regex) {
  return impl_->segmentation_ids.set(mesh_name, object_id, is_name_regex, scene_object_names(*impl_));
}

int Simulator::sim_get_segmentation_object_id(const std::string& mesh_name) {
  const std::string searched = base::to_lower(mesh_name);
  for (const std::string& name : scene_object_names(*impl_)) {
    if (base::to_lower(name) == searched) return impl_->segmentation_ids.lookup(name);
  }
  return -1;
}

std::vector<MeshPositionVertexBuffersResponse> Simulator::sim_get_mesh_position_vertex_buffers() {
  const auto place = impl_->working_set.current();  // of the tiles
  std::size_t vertices = 0;
  for (const imaging::TexturedMesh& mesh : place->scene().meshes()) vertices += mesh.mesh.vertices.size();
  if (vertices > kMaxMeshVertices)
    throw InputError("simGetMeshPositionVertexBuffers",
                     "more than 20 million vertices; use tfGroundTruth for a region");
  std::vector<MeshPositionVertexBuffersResponse> all;
  if (!place->has_surface()) return all;
  for (const imaging::TexturedMesh& mesh : place->scene().meshes())
    all.push_back(make_vertex_buffers(mesh, impl_->T_local_ned.inverse()));
  return all;
}

Pose Simulator::sim_get_object_pose(const std::string& name) {
  {
    const std::lock_guard lock(impl_->state_mutex);
    for (const auto& one : impl_->vehicles) {
      if (one->vehicle->name() == name) return to_airsim(one->vehicle->state().T_ned_body);
    }
  }
  if (const auto object = impl_->world_objects.find(name)) return to_airsim(object->T_ned_object);
  const auto middle = find_object_center(*impl_->working_set.current(), name);
  if (!middle) return {{kNaN, kNaN, kNaN}, {kNaN, kNaN, kNaN, kNaN}};
  return to_airsim(SE3(Eigen::Quaterniond::Identity(), impl_->T_local_ned.inverse() * *middle));
}

bool Simulator::sim_set_object_pose(const std::string& name, const Pose& pose, bool /*teleport*/) {
  const auto object = impl_->world_objects.find(name);
  if (!object) return false;  // AirSim's answer for objects that cannot be moved
  const SE3 target = merge_pose(pose, object->T_ned_object, "simSetObjectPose");
  if (!impl_->world_objects.move(name, target)) return false;
  impl_->update_obstacles();
  return true;
}

Vector3r Simulator::sim_get_object_scale(const std::string& name) {
  if (const auto object = impl_->world_objects.find(name)) return to_airsim(object->scale);
  return find_object_center(*impl_->working_set.current(), name) ? Vector3r{1.0F, 1.0F, 1.0F}
                                                                 : Vector3r{kNaN, kNaN, kNaN};
}

bool Simulator::sim_set_object_scale(const std::string& name, const Vector3r& scale) {
  if (!impl_->world_objects.rescale(name, to_vec3(scale))) return false;
  impl_->update_obstacles();
  return true;
}

std::string Simulator::sim_spawn_object(const std::string& name, const std::string& asset, const Pose& pose,
                                        const Vector3r& scale, bool /*physics*/, bool /*is_blueprint*/) {
  const SE3 target = merge_pose(pose, SE3(), "simSpawnObject");
  const std::string spawned =
      impl_->world_objects.spawn(name, asset, target, to_vec3(scale), impl_->working_set.current()->distinct_names());
  impl_->update_obstacles();
  return spawned;
}

bool Simulator::sim_destroy_object(const std::string& name) {
  if (!impl_->world_objects.destroy(name)) return false;
  impl_->update_obstacles();
  return true;
}

std::vector<std::string> Simulator::sim_list_assets() const { return impl_->world_objects.assets(); }

bool Simulator::sim_create_voxel_grid(const Vector3r& position, int x, int y, int z, float resolution,
                                      const std::string& file) {
  const Vec3 center = impl_->T_local_ned * checked_position(position, "simCreateVoxelGrid");
  const VoxelGridSpec spec = make_airsim_grid(center, Vec3(y, x, z), resolution, kMaxFileCells);
  std::filesystem::path path;
  try {
    path = impl_->file_access.resolve_writable(file);
  } catch (const std::runtime_error& error) {
    impl_->log_line("simCreateVoxelGrid: " + std::string(error.what()));
    return false;  // AirSim's answer where it cannot write
  }
  const geometry::VoxelGrid grid = voxelize_grid(impl_->working_set.triangles_in(spec.box, 0.0), spec);
  return write_airsim_binvox(path, grid, spec, impl_->settings.inverted_voxel_scale);
}

VoxelGridData Simulator::tf_create_voxel_grid(const Vector3r& center, const Vector3r& size, float resolution) {
  const Vec3 edges = to_vec3(size);
  const VoxelGridSpec spec = make_centered_grid(impl_->T_local_ned * checked_position(center, "tfCreateVoxelGrid"),
                                                Vec3(edges.y(), edges.x(), edges.z()), resolution, kMaxAnswerCells);
  return to_voxel_grid_data(voxelize_grid(impl_->working_set.triangles_in(spec.box, 0.0), spec), spec,
                            impl_->T_local_ned);
}

bool Simulator::sim_test_line_of_sight_to_point(const GeoPoint& point, const std::string& vehicle) {
  const Vec3 to = impl_->T_local_ned * impl_->geodetic_frame.to_ned(point);
  Vec3 from = Vec3::Zero();
  {
    const std::lock_guard lock(impl_->state_mutex);
    from = impl_->slot(vehicle).vehicle->position_local();
  }
  return has_line_of_sight(impl_->place_now()->scene(), from, to);
}

bool Simulator::sim_test_line_of_sight_between_points(const GeoPoint& from, const GeoPoint& to) {
  return has_line_of_sight(impl_->place_now()->scene(), impl_->T_local_ned * impl_->geodetic_frame.to_ned(from),
                           impl_->T_local_ned * impl_->geodetic_frame.to_ned(to));
}

std::vector<GeoPoint> Simulator::sim_get_world_extents() {
  const Box3 box = impl_->working_set.bounds();
  const SE3 T_ned_local = impl_->T_local_ned.inverse();
  return {impl_->geodetic_frame.to_geo_point(T_ned_local * box.min()),
          impl_->geodetic_frame.to_geo_point(T_ned_local * box.max())};
}

LoadedRegion Simulator::tf_load_region(const Vector3r& center, const Vector3r& size, float error_m) {
  const Box3 box = to_local_box(impl_->T_local_ned, center, size, "tfLoadRegion");
  const double error = checked_error(error_m, "tfLoadRegion");
  std::vector<SensorViewpoint> viewpoints;
  {
    const std::lock_guard lock(impl_->state_mutex);
    viewpoints = impl_->viewpoints();
  }
  return impl_->working_set.add_region(box, error, viewpoints);
}

/// The error of each pixel is the geometric error of its tile at its distance from the camera.
Coverage Simulator::tf_coverage(const std::string& camera, const std::string& vehicle, bool external) {
  PlannedImages planned;
  {
    const std::lock_guard lock(impl_->state_mutex);
    planned = impl_->plan_images({{camera, 0, false, false}}, vehicle, external);
  }
  const auto place = impl_->place_for(planned.viewpoints);
  const CameraView& shot = planned.images.front().view;
  const double pixels_per_rad = tileset::view_cone_of(shot.lens).pixels_per_rad;
  imaging::FloatImage error_px(shot.lens.width(), shot.lens.height(), -1.0F);
  imaging::Image<std::uint32_t> tile(shot.lens.width(), shot.lens.height());
  impl_->renderer.camera_renderer(place, shot.lens)
      ->visit_surface(std::span(&shot.T_local_camera, 1), [&](const render::SurfacePoint& point) {
        if (!point.hit) return;
        const double error_m = place->geometric_error_m(point.mesh);
        error_px(point.x, point.y) = static_cast<float>(error_m * pixels_per_rad / std::max(1e-3F, point.distance_m));
        tile(point.x, point.y) = place->tile_of_mesh(point.mesh);
      });
  Coverage coverage{.camera_name = camera,
                    .error_wanted = static_cast<float>(impl_->working_set.error_px()),
                    .loaded = place->loaded()};
  std::set<std::uint32_t> seen;
  double sum = 0.0;
  std::size_t surface = 0;
  for (std::size_t i = 0; i < error_px.pixels.size(); ++i) {
    if (error_px.pixels[i] < 0.0F) continue;
    ++surface;
    sum += error_px.pixels[i];
    coverage.error_max = std::max(coverage.error_max, error_px.pixels[i]);
    seen.insert(tile.pixels[i]);
  }
  coverage.complete = coverage.loaded.complete;
  coverage.surface_share = static_cast<float>(surface) / static_cast<float>(error_px.pixels.size());
  coverage.error_mean = surface > 0 ? static_cast<float>(sum / static_cast<double>(surface)) : 0.0F;
  coverage.tiles_seen = static_cast<int>(seen.size());
  return coverage;
}

GroundTruthReport Simulator::tf_ground_truth(const Vector3r& center, const Vector3r& size, float error_m, float voxel_m,
                                             const std::string& folder) {
  const char* call = "tfGroundTruth";
  const Box3 box = to_local_box(impl_->T_local_ned, center, size, call);
  const double error = checked_error(error_m, call);
  make_airsim_grid(box.center(), box.sizes(), voxel_m, kMaxFileCells);  // checks the same limits for the cells
  const std::filesystem::path path = impl_->file_access.resolve_writable(folder);
  if (impl_->options.source.empty()) {
    const auto meshes = impl_->working_set.current()->scene().parts().front()->meshes();
    ground_truth::write_ground_truth(meshes, box, {.voxel_m = voxel_m}, path);
    return {path.string(), "{}"};
  }
  place::ExtractSettings settings{impl_->options.source, impl_->options.load, voxel_m};
  settings.load.center.reset();
  settings.load.areas.clear();
  settings.load.flight.reset();
  settings.load.error_m = error;
  settings.load.size = box.sizes();
  settings.load.max_memory_bytes = impl_->options.max_memory_bytes;
  settings.load.center_local = box.center();
  if (impl_->working_set.local_frame()) settings.load.origin = impl_->working_set.local_frame()->origin();
  return {path.string(), to_json(place::extract(settings, path, true)).dump()};
}

Statistics Simulator::tf_statistics() const {
  const WorkingSet& world = impl_->working_set;
  Statistics s;
  s.wall_seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - impl_->started).count();
  s.images = impl_->images;
  s.image_seconds = impl_->image_seconds;
  s.last_image_seconds = impl_->last_image_seconds;
  s.scenes_built = world.scenes_built();
  s.tiles_read = world.tiles_read();
  s.memory_bytes = world.memory_bytes();
  s.max_memory_bytes = impl_->options.max_memory_bytes;
  s.error_px = static_cast<float>(world.error_px());
  s.mode = world.follows_sensors() ? "follow" : "region";
  s.warnings = impl_->warnings;
  s.attribution = world.attribution();
  const std::lock_guard lock(impl_->state_mutex);
  s.time_stamp = impl_->clock.time_ns();
  s.sim_seconds = impl_->clock.time_s();
  for (const auto& one : impl_->vehicles) s.tasks_running += one->vehicle->busy() ? 1 : 0;
  s.vehicles = static_cast<int>(impl_->vehicles.size());
  return s;
}

}  // namespace tileflight::simulator
