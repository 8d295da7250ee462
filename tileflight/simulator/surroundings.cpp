#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "tileflight/experiment/extract.h"
#include "tileflight/geometry/input_error.h"
#include "tileflight/ground_truth/extract.h"
#include "tileflight/simulator/frames.h"
#include "tileflight/simulator/simulator_impl.h"
#include "tileflight/simulator/voxel_files.h"
#include "tileflight/tiles/viewing.h"

namespace tileflight::simulator {
namespace {

using geometry::Box3;
using geometry::SE3;
using geometry::Vec3;

constexpr std::int64_t kMostFileCells = std::int64_t{1} << 34;
constexpr std::int64_t kMostAnswerCells = std::int64_t{32} << 20;
constexpr std::size_t kMostMeshVertices = 20'000'000;
constexpr float kCentimetres = 100.0F;
constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();
constexpr double kLargestRegion_m = 20000.0;
constexpr double kTouching_m = 0.05;  // a point on the surface is not hidden by it

/// A box of a client's, edges to the north, east and down.
Box3 box_of(const SE3& T_local_ned, const Vector3r& center, const Vector3r& size, const char* call) {
  const Vec3 edges = checked_position(size, call);
  if (edges.minCoeff() <= 0.0 || edges.maxCoeff() > kLargestRegion_m)
    throw InputError(call, "the region's edges must be above 0 and at most 20000 m");
  const Vec3 middle = T_local_ned * checked_position(center, call);
  const Vec3 half = 0.5 * Vec3(edges.y(), edges.x(), edges.z());
  return {middle - half, middle + half};
}

double checked_error(float error_m, const char* call) {
  if (!(error_m >= 0.0F && error_m <= 1e6F)) throw InputError(call, "the geometric error must be 0 m or more");
  return error_m;
}

bool sees(const scene::Scene& scene, const Vec3& from, const Vec3& to) {
  const Vec3 way = to - from;
  const double length_m = way.norm() - kTouching_m;
  return length_m <= kTouching_m ||
         !scene.occluded({from + kTouching_m * way.normalized(), way.normalized()}, length_m - kTouching_m);
}

std::vector<std::string> names_of(const Simulator::Impl& impl) { return impl.world.current()->distinct_names(); }

std::string lower(std::string text) {
  for (char& c : text) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return text;
}

/// Middle of the bounds of what is called so, local frame.
std::optional<Vec3> middle_of(const Place& place, const std::string& name) {
  if (!place.has_surface() || !std::ranges::binary_search(place.distinct_names(), name)) return std::nullopt;
  Box3 box;
  for (std::size_t i = 0; i < place.object_names().size(); ++i) {
    if (place.object_names()[i] == name) box.extend(place.object_bounds()[i]);
  }
  return box.center();
}

/// A mesh as Unreal has it: centimetres, x north, y east, z up (left-handed), so that triangles turn the other way.
MeshPositionVertexBuffersResponse buffers_of(const imaging::TexturedMesh& mesh, const SE3& T_ned_local) {
  MeshPositionVertexBuffersResponse buffers;
  buffers.name = mesh.name;
  for (const Vec3& vertex : mesh.mesh.vertices) {
    const Vector3r ned = wire(T_ned_local * vertex);
    buffers.vertices.insert(buffers.vertices.end(),
                            {kCentimetres * ned.x_val, kCentimetres * ned.y_val, -kCentimetres * ned.z_val});
  }
  for (const geometry::Triangle& t : mesh.mesh.triangles)
    buffers.indices.insert(buffers.indices.end(), t.begin(), t.end());
  return buffers;
}

}  // namespace

std::vector<std::string> Simulator::sim_list_scene_objects(const std::string& name_regex) {
  const NamePattern pattern(name_regex, NamePattern::Case::kHeeded);
  std::vector<std::string> names = names_of(*impl_);
  std::erase_if(names, [&](const std::string& name) { return !pattern.matches(name); });
  return names;
}

bool Simulator::sim_set_segmentation_object_id(const std::string& mesh_name, int object_id, bool is_name_regex) {
  return impl_->ids.set(mesh_name, object_id, is_name_regex, names_of(*impl_));
}

int Simulator::sim_get_segmentation_object_id(const std::string& mesh_name) {
  const std::string wanted = lower(mesh_name);
  for (const std::string& name : names_of(*impl_)) {
    if (lower(name) == wanted) return impl_->ids.of(name);
  }
  return -1;
}

std::vector<MeshPositionVertexBuffersResponse> Simulator::sim_get_mesh_position_vertex_buffers() {
  const auto place = impl_->world.current();
  std::size_t vertices = 0;
  for (const imaging::TexturedMesh& mesh : place->scene().meshes()) vertices += mesh.mesh.vertices.size();
  if (vertices > kMostMeshVertices)
    throw InputError("simGetMeshPositionVertexBuffers", "more than 20 million vertices; use tfGroundTruth of a region");
  std::vector<MeshPositionVertexBuffersResponse> all;
  if (!place->has_surface()) return all;
  for (const imaging::TexturedMesh& mesh : place->scene().meshes())
    all.push_back(buffers_of(mesh, impl_->T_local_ned.inverse()));
  return all;
}

Pose Simulator::sim_get_object_pose(const std::string& name) {
  {
    const std::lock_guard lock(impl_->state);
    for (const auto& one : impl_->fleet) {
      if (one->craft->name() == name) return wire(one->craft->state().T_ned_body);
    }
  }
  const auto middle = middle_of(*impl_->world.current(), name);
  if (!middle) return {{kNaN, kNaN, kNaN}, {kNaN, kNaN, kNaN, kNaN}};
  return wire(SE3(Eigen::Quaterniond::Identity(), impl_->T_local_ned.inverse() * *middle));
}

bool Simulator::sim_set_object_pose(const std::string& /*name*/, const Pose& /*pose*/, bool /*teleport*/) {
  return false;  // as AirSim answers for what cannot be moved: tiles cannot
}

Vector3r Simulator::sim_get_object_scale(const std::string& name) {
  return middle_of(*impl_->world.current(), name) ? Vector3r{1.0F, 1.0F, 1.0F} : Vector3r{kNaN, kNaN, kNaN};
}

bool Simulator::sim_set_object_scale(const std::string& /*name*/, const Vector3r& /*scale*/) { return false; }

std::string Simulator::sim_spawn_object(const std::string& /*name*/, const std::string& /*asset*/, const Pose& /*pose*/,
                                        const Vector3r& /*scale*/, bool /*physics*/, bool /*is_blueprint*/) {
  refuse("simSpawnObject");
}

bool Simulator::sim_destroy_object(const std::string& /*name*/) { return false; }

std::vector<std::string> Simulator::sim_list_assets() const { return {}; }

bool Simulator::sim_create_voxel_grid(const Vector3r& position, int x, int y, int z, float resolution,
                                      const std::string& file) {
  const Vec3 center = impl_->T_local_ned * checked_position(position, "simCreateVoxelGrid");
  const WantedGrid wanted = airsim_grid(center, Vec3(y, x, z), resolution, kMostFileCells);
  const std::filesystem::path path = impl_->files.writable(file);
  const geometry::VoxelGrid grid = occupied(impl_->world.triangles_in(wanted.box, 0.0), wanted);
  return write_airsim_binvox(path, grid, wanted, impl_->settings.inverted_voxel_scale);
}

VoxelGridData Simulator::tf_create_voxel_grid(const Vector3r& center, const Vector3r& size, float resolution) {
  const Vec3 edges = vec3(size);
  const WantedGrid wanted = centered_grid(impl_->T_local_ned * checked_position(center, "tfCreateVoxelGrid"),
                                          Vec3(edges.y(), edges.x(), edges.z()), resolution, kMostAnswerCells);
  return grid_data(occupied(impl_->world.triangles_in(wanted.box, 0.0), wanted), wanted, impl_->T_local_ned);
}

bool Simulator::sim_test_line_of_sight_to_point(const GeoPoint& point, const std::string& vehicle) {
  const Vec3 to = impl_->T_local_ned * impl_->earth.ned(point);
  Vec3 from = Vec3::Zero();
  {
    const std::lock_guard lock(impl_->state);
    from = impl_->vehicle(vehicle).craft->position_local();
  }
  return sees(impl_->world.current()->scene(), from, to);
}

bool Simulator::sim_test_line_of_sight_between_points(const GeoPoint& from, const GeoPoint& to) {
  return sees(impl_->world.current()->scene(), impl_->T_local_ned * impl_->earth.ned(from),
              impl_->T_local_ned * impl_->earth.ned(to));
}

std::vector<GeoPoint> Simulator::sim_get_world_extents() {
  const Box3 box = impl_->world.bounds();
  const SE3 T_ned_local = impl_->T_local_ned.inverse();
  return {impl_->earth.geo_point(T_ned_local * box.min()), impl_->earth.geo_point(T_ned_local * box.max())};
}

LoadedRegion Simulator::tf_load_region(const Vector3r& center, const Vector3r& size, float error_m) {
  const Box3 box = box_of(impl_->T_local_ned, center, size, "tfLoadRegion");
  const double error = checked_error(error_m, "tfLoadRegion");
  std::vector<Look> looks;
  {
    const std::lock_guard lock(impl_->state);
    looks = impl_->looks();
  }
  return impl_->world.add_region(box, error, looks);
}

/// Each pixel's tile errs by its geometric error, seen from where the camera is.
Coverage Simulator::tf_coverage(const std::string& camera, const std::string& vehicle, bool external) {
  PlannedPictures planned;
  {
    const std::lock_guard lock(impl_->state);
    planned = impl_->plan({{camera, 0, false, false}}, vehicle, external);
  }
  const auto place = impl_->world.for_looks(planned.looks);
  const Shot& shot = planned.pictures.front().shot;
  const double pixels_per_rad = tiles::eye_of(shot.lens).pixels_per_rad;
  imaging::FloatImage error_px(shot.lens.width(), shot.lens.height(), -1.0F);
  imaging::Image<std::uint32_t> tile(shot.lens.width(), shot.lens.height());
  impl_->renderer.renderer(place, shot.lens)
      ->visit_surface(std::span(&shot.T_local_camera, 1), [&](const sensors::SurfacePoint& point) {
        if (!point.hit) return;
        const double error_m = place->geometric_error_m(point.mesh);
        error_px(point.x, point.y) = static_cast<float>(error_m * pixels_per_rad / std::max(1e-3F, point.distance_m));
        tile(point.x, point.y) = place->tile_of_mesh(point.mesh);
      });
  Coverage coverage{
      .camera_name = camera, .error_wanted = static_cast<float>(impl_->world.error_px()), .loaded = place->loaded()};
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
  const Box3 box = box_of(impl_->T_local_ned, center, size, call);
  const double error = checked_error(error_m, call);
  airsim_grid(box.center(), box.sizes(), voxel_m, kMostFileCells);  // the same bounds for cells
  const std::filesystem::path path = impl_->files.writable(folder);
  if (impl_->options.source.empty()) {
    ground_truth::write_ground_truth(impl_->world.current()->scene().meshes(), box, {.voxel_m = voxel_m}, path);
    return {path.string(), "{}"};
  }
  experiment::ExtractSettings settings{impl_->options.source, impl_->options.load, voxel_m};
  settings.load.center.reset();
  settings.load.areas.clear();
  settings.load.flight.reset();
  settings.load.error_m = error;
  settings.load.size = box.sizes();
  settings.load.max_memory_bytes = impl_->options.max_memory_bytes;
  settings.load.center_local = box.center();
  if (impl_->world.local_frame()) settings.load.origin = impl_->world.local_frame()->origin();
  return {path.string(), experiment::extract(settings, path, true).dump()};
}

Statistics Simulator::tf_statistics() const {
  const WorkingSet& world = impl_->world;
  Statistics s;
  s.wall_seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - impl_->started).count();
  s.images = impl_->images;
  s.image_seconds = impl_->image_seconds;
  s.last_image_seconds = impl_->last_image_seconds;
  s.scenes_built = world.places_built();
  s.tiles_read = world.tiles_read();
  s.memory_bytes = world.current() ? world.current()->loaded().bytes : 0;
  s.max_memory_bytes = impl_->options.max_memory_bytes;
  s.error_px = static_cast<float>(world.error_px());
  s.mode = world.follows() ? "follow" : "region";
  s.warnings = impl_->warnings;
  s.attribution = world.attribution();
  const std::lock_guard lock(impl_->state);
  s.time_stamp = impl_->engine.time_ns();
  s.sim_seconds = impl_->engine.time_s();
  for (const auto& one : impl_->fleet) s.tasks_running += one->craft->busy() ? 1 : 0;
  s.vehicles = static_cast<int>(impl_->fleet.size());
  return s;
}

}  // namespace tileflight::simulator
