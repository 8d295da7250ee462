#include "tileflight/world/ground_truth/truth_folder.h"

#include <tbb/parallel_sort.h>

#include <algorithm>
#include <limits>
#include <nlohmann/json.hpp>
#include <numeric>
#include <optional>
#include <string>
#include <tuple>
#include <utility>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/geometry/cloud_files.h"
#include "tileflight/core/geometry/point_order.h"
#include "tileflight/core/geometry/voxel_grid.h"

namespace tileflight::ground_truth {
namespace {

using geometry::Box3;
using geometry::PointCloud;
using geometry::TriangleMesh;
using geometry::Vec3;
using nlohmann::json;

Box3 everywhere() {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  return {Vec3::Constant(-kInfinity), Vec3::Constant(kInfinity)};
}

/// Three finite numbers of a block's entry, or nullopt.
std::optional<Vec3> corner_of(const json& block, const char* key) {
  const json corner = block.value(key, json());
  if (!corner.is_array() || corner.size() != 3) return std::nullopt;
  Vec3 point;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (!corner[axis].is_number()) return std::nullopt;
    point[static_cast<Eigen::Index>(axis)] = corner[axis].get<double>();
  }
  return point.allFinite() ? std::optional(point) : std::nullopt;
}

}  // namespace

TruthFolder::TruthFolder(std::filesystem::path folder) : folder_(std::move(folder)) {
  const std::filesystem::path index = folder_ / "index.json";
  if (std::filesystem::exists(index)) {
    read_index(index);
  } else {
    const bool has_mesh = std::filesystem::exists(folder_ / "mesh.glb");
    parts_.push_back({folder_, has_mesh, {}, {}});
  }
  if (parts_.size() == 1) {
    parts_.front().voxel_bounds = everywhere();
    if (parts_.front().has_mesh) parts_.front().mesh_bounds = everywhere();
    return;
  }
  // A cell's centre by the paper's equation may lie an ulp outside it.
  const Vec3 slack = Vec3::Constant(voxel_m());
  for (Part& part : parts_) {
    part.voxel_bounds = Box3(part.voxel_bounds.min() - slack, part.voxel_bounds.max() + slack);
    if (part.has_mesh) part.mesh_bounds = read_mesh_glb_bounds(part.folder / "mesh.glb");
  }
}

void TruthFolder::read_index(const std::filesystem::path& index) {
  const json content = json::parse(base::read_text(index), nullptr, false);
  const auto blocks = content.is_object() ? content.value("blocks", json()) : json();
  if (!blocks.is_array() || blocks.empty())
    throw InputError(index.string(), "names no blocks; make the folder with `tileflight extract`");
  for (const json& block : blocks) {
    const json name = block.is_object() ? block.value("folder", json()) : json();
    const auto low = name.is_string() ? corner_of(block, "min") : std::nullopt;
    const auto high = name.is_string() ? corner_of(block, "max") : std::nullopt;
    if (!low || !high)
      throw InputError(index.string(),
                       "block " + std::to_string(parts_.size()) +
                           " has no valid folder, min and max; make the folder with `tileflight extract`");
    const std::filesystem::path own = folder_ / name.get<std::string>();
    parts_.push_back({own, std::filesystem::exists(own / "mesh.glb"), {}, Box3(*low, *high)});
  }
}

double TruthFolder::voxel_m() const {
  return geometry::read_binvox_header(parts_.front().folder / "voxels.binvox").edge_m;
}

bool TruthFolder::has_mesh() const {
  return std::ranges::any_of(parts_, [](const Part& part) { return part.has_mesh; });
}

NumberedMesh TruthFolder::read_mesh(std::size_t part) const {
  if (!parts_[part].has_mesh) return {};
  return read_numbered_mesh_glb(parts_[part].folder / "mesh.glb");
}

PointCloud TruthFolder::read_voxel_centers(std::size_t part) const {
  return geometry::read_cloud(parts_[part].folder / "voxels.ply");
}

TriangleMesh TruthFolder::read_meshes(const std::vector<std::size_t>& parts) const {
  std::vector<NumberedMesh> meshes;
  for (const std::size_t part : parts) meshes.push_back(read_mesh(part));
  if (meshes.size() == 1) return std::move(meshes.front().mesh);
  return merge_in_order(meshes);
}

PointCloud TruthFolder::read_voxel_centers(const std::vector<std::size_t>& parts) const {
  PointCloud all;
  for (const std::size_t part : parts) {
    const PointCloud centers = read_voxel_centers(part);
    all.positions.insert(all.positions.end(), centers.positions.begin(), centers.positions.end());
  }
  if (parts.size() > 1) {
    std::ranges::sort(all.positions, [](const Vec3& a, const Vec3& b) {
      return std::tuple(a.x(), a.y(), a.z()) < std::tuple(b.x(), b.y(), b.z());
    });
  }
  return all;
}

PointCloud TruthFolder::read_surface_samples() const {
  PointCloud all = geometry::read_cloud(parts_.front().folder / "surface.ply");
  if (parts_.size() == 1) return all;
  for (std::size_t i = 1; i < parts_.size(); ++i) {
    const PointCloud part = geometry::read_cloud(parts_[i].folder / "surface.ply");
    all.positions.insert(all.positions.end(), part.positions.begin(), part.positions.end());
    all.normals.insert(all.normals.end(), part.normals.begin(), part.normals.end());
  }
  geometry::sort_by_position(all);
  return all;
}

std::vector<std::size_t> TruthFolder::parts_in(const Box3& box) const {
  std::vector<std::size_t> found;
  for (std::size_t i = 0; i < parts_.size(); ++i) {
    if (parts_[i].mesh_bounds.intersects(box) || parts_[i].voxel_bounds.intersects(box)) found.push_back(i);
  }
  return found;
}

std::vector<std::size_t> TruthFolder::all_parts() const {
  std::vector<std::size_t> all(parts_.size());
  std::iota(all.begin(), all.end(), std::size_t{0});
  return all;
}

TriangleMesh merge_in_order(const std::vector<NumberedMesh>& parts) {
  TriangleMesh all;
  std::vector<std::pair<std::uint64_t, geometry::Triangle>> triangles;
  for (const NumberedMesh& part : parts) {
    const auto first = static_cast<std::uint32_t>(all.vertices.size());
    all.vertices.insert(all.vertices.end(), part.mesh.vertices.begin(), part.mesh.vertices.end());
    for (std::size_t i = 0; i < part.mesh.triangles.size(); ++i) {
      const geometry::Triangle& t = part.mesh.triangles[i];
      triangles.emplace_back(part.numbers[i], geometry::Triangle{first + t[0], first + t[1], first + t[2]});
    }
  }
  tbb::parallel_sort(triangles.begin(), triangles.end());
  all.triangles.reserve(triangles.size());
  for (const auto& [number, triangle] : triangles) all.triangles.push_back(triangle);
  return all;
}

GroundTruth read_ground_truth(const std::filesystem::path& folder) {
  const TruthFolder truth(folder);
  return {truth.read_meshes(truth.all_parts()), truth.read_voxel_centers(truth.all_parts()), truth.voxel_m()};
}

PointCloud read_surface_samples(const std::filesystem::path& folder) {
  return TruthFolder(folder).read_surface_samples();
}

}  // namespace tileflight::ground_truth
