#include "tileflight/ground_truth/ground_truth.h"

#include <algorithm>
#include <functional>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>
#include <tuple>

#include "tileflight/base/files.h"
#include "tileflight/base/input_error.h"
#include "tileflight/geometry/cloud_files.h"
#include "tileflight/geometry/position_order.h"
#include "tileflight/ground_truth/center_distances.h"
#include "tileflight/ground_truth/mesh_glb.h"
#include "tileflight/ground_truth/octree.h"
#include "tileflight/ground_truth/point_cells.h"
#include "tileflight/ground_truth/surface_samples.h"
#include "tileflight/ground_truth/triangle_cells.h"

namespace tileflight::ground_truth {
namespace {

using geometry::Box3;
using geometry::PointCloud;
using geometry::Prism;
using geometry::Vec3;
using imaging::TexturedMesh;

constexpr std::uint32_t kUnused = std::numeric_limits<std::uint32_t>::max();

/// Whether a triangle touches the box: the separating axis test with the box as the only cell. Throws InputError if a
/// corner is not finite.
bool triangle_meets_box(const geometry::TriangleMesh& mesh, const geometry::Triangle& t, const Box3& box) {
  CellTriangle in_boxes;
  for (std::size_t k = 0; k < 3; ++k) in_boxes[k] = (mesh.vertices[t[k]] - box.min()).cwiseQuotient(box.sizes());
  for (const Vec3& p : in_boxes) {
    if (!p.allFinite()) throw InputError("mesh", "a vertex is not finite");
  }
  bool touched = false;
  visit_touched_cells(in_boxes, {1, 1, 1}, [&](const auto&, std::size_t, std::int32_t) { touched = true; });
  return touched;
}

bool any_contains(const std::vector<Prism>& within, const Vec3& point) {
  return within.empty() ||
         std::any_of(within.begin(), within.end(), [&](const Prism& part) { return contains(part, point); });
}

bool meets_any_prism(const std::vector<Prism>& within, const geometry::TriangleMesh& mesh,
                     const geometry::Triangle& t) {
  return within.empty() || std::any_of(within.begin(), within.end(), [&](const Prism& part) {
           return geometry::intersects(part, {mesh.vertices[t[0]], mesh.vertices[t[1]], mesh.vertices[t[2]]});
         });
}

void erase_points(PointCloud& cloud, const std::function<bool(const Vec3&)>& unwanted) {
  std::size_t kept = 0;
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    if (unwanted(cloud.positions[i])) continue;
    cloud.positions[kept] = cloud.positions[i];
    if (!cloud.normals.empty()) cloud.normals[kept] = cloud.normals[i];
    ++kept;
  }
  cloud.positions.resize(kept);
  if (!cloud.normals.empty()) cloud.normals.resize(kept);
}

PointCloud crop_points(const std::vector<Prism>& within, PointCloud cloud) {
  erase_points(cloud, [&](const Vec3& p) { return !any_contains(within, p); });
  return cloud;
}

/// Which triangles are wanted.
using TriangleFilter = std::function<bool(const geometry::TriangleMesh&, const geometry::Triangle&)>;

/// The wanted triangles of a mesh, with only the vertices they use.
TexturedMesh crop_mesh(const TexturedMesh& whole, const TriangleFilter& wanted) {
  TexturedMesh part = whole;
  part.mesh = {};
  part.uv.clear();
  part.colors.clear();
  part.feature_ids.clear();
  std::vector<std::uint32_t> new_index(whole.mesh.vertices.size(), kUnused);
  const auto moved = [&](std::uint32_t vertex) {
    if (new_index[vertex] == kUnused) {
      new_index[vertex] = static_cast<std::uint32_t>(part.mesh.vertices.size());
      part.mesh.vertices.push_back(whole.mesh.vertices[vertex]);
      if (!whole.uv.empty()) part.uv.push_back(whole.uv[vertex]);
      if (!whole.colors.empty()) part.colors.push_back(whole.colors[vertex]);
      if (!whole.feature_ids.empty()) part.feature_ids.push_back(whole.feature_ids[vertex]);
    }
    return new_index[vertex];
  };
  for (const geometry::Triangle& t : whole.mesh.triangles) {
    if (wanted(whole.mesh, t)) part.mesh.triangles.push_back({moved(t[0]), moved(t[1]), moved(t[2])});
  }
  return part;
}

/// Meshes of a region, and the centre of the mesh that each was cut from: stored positions are relative to it, so that
/// they do not depend on the cut.
struct CroppedMeshes {
  std::vector<TexturedMesh> meshes;
  std::vector<Vec3> centers;
};

CroppedMeshes crop_meshes(const std::vector<TexturedMesh>& meshes, const TriangleFilter& wanted) {
  CroppedMeshes parts;
  for (const TexturedMesh& mesh : meshes) {
    TexturedMesh part = crop_mesh(mesh, wanted);
    if (part.mesh.triangles.empty()) continue;
    parts.meshes.push_back(std::move(part));
    parts.centers.emplace_back(geometry::bounds(mesh.mesh).center());
  }
  return parts;
}

/// The part of a region that one call writes: everything, or one block.
class WrittenPart {
 public:
  WrittenPart(const Box3& box, const GroundTruthOptions& options)
      : box_(box),
        grid_{box.min(), options.voxel_m, grid_dims(box, options.voxel_m), {}},
        block_(options.block ? options.block->cells : whole_grid(grid_.dims)),
        covered_(whole_grid(grid_.dims)),
        is_whole_(!options.block) {
    if (is_whole_) return;
    border_ = options.block->border;
    CellRange wider = block_;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      wider.low[axis] -= border_;
      wider.high[axis] += border_;
    }
    covered_ = intersection(wider, covered_);
  }

  const CellRange& block() const { return block_; }
  /// The cells of the block and of its border.
  const CellRange& covered() const { return covered_; }
  /// Whether a position in the region, or outside the one nearest to it, is of this part.
  bool owns(const Vec3& position) const {
    return is_whole_ || block_.contains(nearest_cell(position.cwiseMax(box_.min()).cwiseMin(box_.max()), grid_));
  }
  bool owns(const geometry::TriangleMesh& mesh, const geometry::Triangle& t) const {
    return is_whole_ || owns(mesh.vertices[t[0]].cwiseMin(mesh.vertices[t[1]]).cwiseMin(mesh.vertices[t[2]]));
  }
  /// The part of the region in which owned samples lie, slightly enlarged.
  Box3 bounds() const {
    if (is_whole_) return box_;
    const Vec3 slack = Vec3::Constant(grid_.edge_m);
    const auto corner = [&](const std::array<std::int32_t, 3>& cell) {
      return Vec3(grid_.origin + grid_.edge_m * Vec3(cell[0], cell[1], cell[2]));
    };
    Box3 part(corner(block_.low) - slack, corner(block_.high) + 2.0 * slack);
    // The outermost cells reach to the region's faces.
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if (block_.high[axis] + 1 < grid_.dims[axis]) continue;
      const auto a = static_cast<Eigen::Index>(axis);
      part.max()[a] = std::max(part.max()[a], box_.max()[a]);
    }
    return part;
  }
  /// Whether voxels outside the covered cells could be nearer to an owned sample than this distance.
  bool may_be_nearer_outside(double distance_m) const {
    const CellRange whole = whole_grid(grid_.dims);
    if (covered_.low == whole.low && covered_.high == whole.high) return false;
    return distance_m > (border_ + 0.5) * grid_.edge_m;
  }

 private:
  Box3 box_;
  geometry::VoxelGrid grid_;
  CellRange block_, covered_;
  bool is_whole_;
  std::int32_t border_ = 0;
};

void write_files(const CroppedMeshes& parts, const PointCloud& surface, const geometry::VoxelGrid& voxels,
                 const GroundTruthOptions& options, const std::filesystem::path& folder, const Progress& progress) {
  if (!parts.meshes.empty())
    write_mesh_glb(folder / "mesh.glb", parts.meshes, options.textured_mesh, progress, parts.centers);
  const geometry::VoxelGrid own_grid = options.block ? grid_of_block(voxels, options.block->cells) : voxels;
  constexpr int kFiles = 4;
  report_progress(progress, 0, kFiles, "writing ground truth");
  geometry::write_cloud(folder / "surface.ply", surface);
  report_progress(progress, 1, kFiles, "writing ground truth");
  geometry::write_binvox(folder / "voxels.binvox", own_grid);
  report_progress(progress, 2, kFiles, "writing ground truth");
  geometry::write_cloud(folder / "voxels.ply", geometry::cell_centers(voxels));
  report_progress(progress, 3, kFiles, "writing ground truth");
  write_octree(folder / "octree.bt", own_grid);
  report_progress(progress, kFiles, kFiles, "writing ground truth");
}

/// Samples of the surface and points without surface, in the order of sort_by_position().
PointCloud owned_surface(const geometry::TriangleMesh& mesh, PointCloud points, const Box3& box,
                         const GroundTruthOptions& options, const WrittenPart& part) {
  PointCloud surface = sample_surface_near(mesh, box, part.bounds(), options.samples_per_m2, 1, [&](const Vec3& p) {
    return part.owns(p) && any_contains(options.prisms, p);
  });
  erase_points(points, [&](const Vec3& p) { return !part.owns(p); });
  if (points.empty()) return surface;
  surface.positions.insert(surface.positions.end(), points.positions.begin(), points.positions.end());
  surface.normals.insert(surface.normals.end(), points.normals.begin(), points.normals.end());
  geometry::sort_by_position(surface);
  return surface;
}

}  // namespace

GroundTruthSummary write_ground_truth(const std::vector<TexturedMesh>& meshes, const Box3& box,
                                      const GroundTruthOptions& options, const std::filesystem::path& folder,
                                      const Progress& progress, const std::vector<geometry::PointCloud>& clouds) {
  if (box.isEmpty() || !(box.sizes().minCoeff() > 0.0)) throw InputError("region", "is empty");
  const WrittenPart part(box, options);
  const auto in_box = [&](const geometry::TriangleMesh& mesh, const geometry::Triangle& t) {
    return triangle_meets_box(mesh, t, box);
  };
  const auto in_region = [&](const geometry::TriangleMesh& mesh, const geometry::Triangle& t) {
    return triangle_meets_box(mesh, t, box) && meets_any_prism(options.prisms, mesh, t);
  };
  const geometry::TriangleMesh mesh = scene::merge_meshes(crop_meshes(meshes, in_region).meshes);
  const CroppedMeshes owned = crop_meshes(meshes, [&](const geometry::TriangleMesh& m, const geometry::Triangle& t) {
    return in_region(m, t) && part.owns(m, t);
  });
  const PointCloud points = crop_points(options.prisms, points_in_box(clouds, box));
  if (mesh.triangles.empty() && points.empty() && !options.block)
    throw InputError("region", "contains no triangle: check its centre, size and height");

  GroundTruthSummary result;
  for (const TexturedMesh& m : owned.meshes) result.triangles += m.mesh.triangles.size();
  // A cell at a polygon's edge may be touched only from outside the polygon.
  result.voxels = voxelize(options.prisms.empty() ? mesh : scene::merge_meshes(crop_meshes(meshes, in_box).meshes), box,
                           options.voxel_m, part.covered(), progress);
  mark_occupied(points, result.voxels);
  std::erase_if(result.voxels.occupied, [&](const geometry::Cell& cell) {
    return !part.covered().contains(cell) || !any_contains(options.prisms, result.voxels.center(cell));
  });
  result.cloud_points =
      static_cast<std::size_t>(std::ranges::count_if(points.positions, [&](const Vec3& p) { return part.owns(p); }));
  const PointCloud surface = owned_surface(mesh, points, box, options, part);
  result.surface_points = surface.size();
  if (!result.voxels.occupied.empty()) result.quantization_floor_m = center_distances(surface.positions, result.voxels);
  const double farthest_m = result.quantization_floor_m.empty() ? std::numeric_limits<double>::infinity()
                                                                : std::ranges::max(result.quantization_floor_m);
  result.border_too_narrow = !surface.empty() && part.may_be_nearer_outside(farthest_m);
  std::erase_if(result.voxels.occupied, [&](const geometry::Cell& cell) { return !part.block().contains(cell); });
  const bool is_empty = owned.meshes.empty() && surface.empty() && result.voxels.occupied.empty();
  if (!result.border_too_narrow && !is_empty) write_files(owned, surface, result.voxels, options, folder, progress);
  return result;
}

geometry::VoxelGrid grid_of_block(const geometry::VoxelGrid& voxels, const CellRange& block) {
  geometry::VoxelGrid own{voxels.origin + voxels.edge_m * Vec3(block.low[0], block.low[1], block.low[2]),
                          voxels.edge_m,
                          {},
                          voxels.occupied};
  for (std::size_t axis = 0; axis < 3; ++axis) own.dims[axis] = static_cast<std::int32_t>(block.count(axis));
  for (geometry::Cell& cell : own.occupied)
    cell = {cell.x - block.low[0], cell.y - block.low[1], cell.z - block.low[2]};
  return own;
}

std::vector<std::filesystem::path> block_folders(const std::filesystem::path& folder) {
  const std::filesystem::path index = folder / "index.json";
  if (!std::filesystem::exists(index)) return {folder};
  const nlohmann::json content = nlohmann::json::parse(base::read_text(index), nullptr, false);
  std::vector<std::filesystem::path> folders;
  const auto found = content.is_object() ? content.find("blocks") : content.end();
  if (content.is_object() && found != content.end() && found->is_array()) {
    for (const nlohmann::json& block : *found) {
      if (!block.is_object() || !block.value("folder", nlohmann::json()).is_string()) continue;
      folders.push_back(folder / block["folder"].get<std::string>());
    }
  }
  if (folders.empty()) throw InputError(index.string(), "names no blocks; make the folder with `tileflight extract`");
  return folders;
}

std::vector<std::filesystem::path> mesh_files(const std::filesystem::path& folder) {
  std::vector<std::filesystem::path> files;
  for (const std::filesystem::path& block : block_folders(folder)) {
    if (std::filesystem::exists(block / "mesh.glb")) files.push_back(block / "mesh.glb");
  }
  return files;
}

GroundTruth read_ground_truth(const std::filesystem::path& folder) {
  GroundTruth truth;
  for (const std::filesystem::path& file : mesh_files(folder)) {
    const geometry::TriangleMesh part = read_mesh_glb(file);
    const auto first = static_cast<std::uint32_t>(truth.mesh.vertices.size());
    truth.mesh.vertices.insert(truth.mesh.vertices.end(), part.vertices.begin(), part.vertices.end());
    for (const geometry::Triangle& t : part.triangles)
      truth.mesh.triangles.push_back({first + t[0], first + t[1], first + t[2]});
  }
  const std::vector<std::filesystem::path> folders = block_folders(folder);
  for (const std::filesystem::path& block : folders) {
    const PointCloud centers = geometry::read_cloud(block / "voxels.ply");
    truth.voxel_centers.positions.insert(truth.voxel_centers.positions.end(), centers.positions.begin(),
                                         centers.positions.end());
  }
  if (folders.size() > 1) {
    std::ranges::sort(truth.voxel_centers.positions, [](const Vec3& a, const Vec3& b) {
      return std::tuple(a.x(), a.y(), a.z()) < std::tuple(b.x(), b.y(), b.z());
    });
  }
  truth.voxel_m = geometry::read_binvox_header(folders.front() / "voxels.binvox").edge_m;
  return truth;
}

geometry::PointCloud read_surface_samples(const std::filesystem::path& folder) {
  const std::vector<std::filesystem::path> folders = block_folders(folder);
  geometry::PointCloud all = geometry::read_cloud(folders.front() / "surface.ply");
  if (folders.size() == 1) return all;
  for (std::size_t i = 1; i < folders.size(); ++i) {
    const geometry::PointCloud part = geometry::read_cloud(folders[i] / "surface.ply");
    all.positions.insert(all.positions.end(), part.positions.begin(), part.positions.end());
    all.normals.insert(all.normals.end(), part.normals.begin(), part.normals.end());
  }
  geometry::sort_by_position(all);
  return all;
}

}  // namespace tileflight::ground_truth
