#include "tileflight/world/ground_truth/ground_truth.h"

#include <algorithm>
#include <functional>
#include <limits>
#include <string>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/geometry/cloud_files.h"
#include "tileflight/core/geometry/point_order.h"
#include "tileflight/world/ground_truth/center_index.h"
#include "tileflight/world/ground_truth/octree.h"
#include "tileflight/world/ground_truth/surface_samples.h"
#include "tileflight/world/ground_truth/triangle_cells.h"
#include "tileflight/world/ground_truth/voxelize.h"

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

/// Selects the triangles that are wanted.
using TriangleFilter = std::function<bool(const geometry::TriangleMesh&, const geometry::Triangle&)>;

/// The wanted triangles of a mesh, with only the vertices they use. `numbers` receives their numbers in the whole.
TexturedMesh crop_mesh(const TexturedMesh& whole, const TriangleFilter& wanted, std::vector<std::uint32_t>& numbers) {
  TexturedMesh part{.texture = whole.texture,
                    .wrap_u = whole.wrap_u,
                    .wrap_v = whole.wrap_v,
                    .base_color = whole.base_color,
                    .blends = whole.blends,
                    .opacity = whole.opacity,
                    .features = whole.features,
                    .name = whole.name};
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
  for (std::size_t i = 0; i < whole.mesh.triangles.size(); ++i) {
    const geometry::Triangle& t = whole.mesh.triangles[i];
    if (!wanted(whole.mesh, t)) continue;
    part.mesh.triangles.push_back({moved(t[0]), moved(t[1]), moved(t[2])});
    numbers.push_back(static_cast<std::uint32_t>(i));
  }
  return part;
}

/// Meshes of a region, and the centre of the mesh that each was cut from: stored positions are relative to it, so that
/// they do not depend on the cut.
struct CroppedMeshes {
  std::vector<TexturedMesh> meshes;
  std::vector<Vec3> centers;
  std::vector<MeshOrigin> origins;  ///< if those of the whole meshes are known

  void add(const TexturedMesh& whole, const TriangleFilter& wanted, const MeshOrigin* origin = nullptr) {
    MeshOrigin numbers = origin != nullptr ? MeshOrigin{origin->content, origin->first, {}} : MeshOrigin();
    TexturedMesh part = crop_mesh(whole, wanted, numbers.triangles);
    if (part.mesh.triangles.empty()) return;
    meshes.push_back(std::move(part));
    centers.emplace_back(geometry::bounds(whole.mesh).center());
    if (origin != nullptr) origins.push_back(std::move(numbers));
  }
};

CroppedMeshes crop_meshes(const std::vector<TexturedMesh>& meshes, const TriangleFilter& wanted,
                          const std::vector<MeshOrigin>& origins = {}) {
  CroppedMeshes parts;
  for (std::size_t i = 0; i < meshes.size(); ++i) parts.add(meshes[i], wanted, origins.empty() ? nullptr : &origins[i]);
  return parts;
}

/// Crops likewise, and releases each whole mesh.
CroppedMeshes crop_and_release(std::vector<TexturedMesh>& meshes, const TriangleFilter& wanted) {
  CroppedMeshes parts;
  for (TexturedMesh& mesh : meshes) {
    parts.add(mesh, wanted);
    mesh = {};
  }
  meshes.clear();
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

void write_mesh(const CroppedMeshes& parts, const GroundTruthOptions& options, const std::filesystem::path& folder,
                const Progress& progress) {
  if (parts.meshes.empty()) return;
  write_mesh_glb(folder / "mesh.glb", parts.meshes, options.textured_mesh, progress, parts.centers, parts.origins);
}

void write_points_and_voxels(const PointCloud& surface, const geometry::VoxelGrid& voxels,
                             const GroundTruthOptions& options, const std::filesystem::path& folder,
                             const Progress& progress) {
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

GroundTruthSummary write_ground_truth(std::vector<TexturedMesh> meshes, const Box3& box,
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
  const PointCloud points = crop_points(options.prisms, points_in_box(clouds, box));
  // A cell at a polygon's edge may be touched only from outside the polygon.
  geometry::TriangleMesh around;
  if (!options.prisms.empty()) around = scene::merge_meshes(crop_meshes(meshes, in_box).meshes);
  CroppedMeshes owned;
  if (options.block) {
    owned = crop_meshes(
        meshes,
        [&](const geometry::TriangleMesh& m, const geometry::Triangle& t) {
          return in_region(m, t) && part.owns(m, t);
        },
        options.block->origins);
  }
  CroppedMeshes inside = crop_and_release(meshes, in_region);
  const geometry::TriangleMesh mesh = scene::merge_meshes(inside.meshes);
  if (mesh.triangles.empty() && points.empty() && !options.block)
    throw InputError("region", "contains no triangle: check its centre, size and height");

  GroundTruthSummary result;
  for (const TexturedMesh& m : (options.block ? owned : inside).meshes) result.triangles += m.mesh.triangles.size();
  // Textures are the largest part of a place, and only this file needs them.
  if (!options.block) write_mesh(inside, options, folder, progress);
  inside = {};
  result.voxels = voxelize(options.prisms.empty() ? mesh : around, box, options.voxel_m, part.covered(), progress);
  around = {};
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
  const bool is_empty = options.block && owned.meshes.empty() && surface.empty() && result.voxels.occupied.empty();
  if (result.border_too_narrow || is_empty) return result;
  write_mesh(owned, options, folder, progress);
  write_points_and_voxels(surface, result.voxels, options, folder, progress);
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

}  // namespace tileflight::ground_truth
