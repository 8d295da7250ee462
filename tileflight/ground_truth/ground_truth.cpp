#include "tileflight/ground_truth/ground_truth.h"

#include <algorithm>
#include <limits>
#include <string>

#include "tileflight/base/input_error.h"
#include "tileflight/geometry/cloud_files.h"
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

PointCloud crop_points(const std::vector<Prism>& within, PointCloud cloud) {
  std::size_t kept = 0;
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    if (!any_contains(within, cloud.positions[i])) continue;
    cloud.positions[kept] = cloud.positions[i];
    if (!cloud.normals.empty()) cloud.normals[kept] = cloud.normals[i];
    ++kept;
  }
  cloud.positions.resize(kept);
  if (!cloud.normals.empty()) cloud.normals.resize(kept);
  return cloud;
}

/// The triangles of a mesh that intersect the box and the polygons, with only the vertices they use.
TexturedMesh crop_mesh(const TexturedMesh& whole, const Box3& box, const std::vector<Prism>& within) {
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
    if (triangle_meets_box(whole.mesh, t, box) && meets_any_prism(within, whole.mesh, t))
      part.mesh.triangles.push_back({moved(t[0]), moved(t[1]), moved(t[2])});
  }
  return part;
}

std::vector<TexturedMesh> crop_meshes(const std::vector<TexturedMesh>& meshes, const Box3& box,
                                      const std::vector<Prism>& within) {
  std::vector<TexturedMesh> parts;
  for (const TexturedMesh& mesh : meshes) {
    TexturedMesh part = crop_mesh(mesh, box, within);
    if (!part.mesh.triangles.empty()) parts.push_back(std::move(part));
  }
  return parts;
}

}  // namespace

GroundTruthSummary write_ground_truth(const std::vector<TexturedMesh>& meshes, const Box3& box,
                                      const GroundTruthOptions& options, const std::filesystem::path& folder,
                                      const Progress& progress, const std::vector<geometry::PointCloud>& clouds) {
  if (box.isEmpty() || !(box.sizes().minCoeff() > 0.0)) throw InputError("region", "is empty");
  const std::vector<TexturedMesh> parts = crop_meshes(meshes, box, options.prisms);
  const PointCloud points = crop_points(options.prisms, points_in_box(clouds, box));
  if (parts.empty() && points.empty())
    throw InputError("region", "contains no triangle: check its centre, size and height");
  const geometry::TriangleMesh mesh = scene::merge_meshes(parts);

  GroundTruthSummary result;
  result.triangles = mesh.triangles.size();
  // A cell at a polygon's edge may be touched only from outside the polygon.
  result.voxels = options.prisms.empty()
                      ? voxelize(mesh, box, options.voxel_m, progress)
                      : voxelize(scene::merge_meshes(crop_meshes(meshes, box, {})), box, options.voxel_m, progress);
  mark_occupied(points, result.voxels);
  std::erase_if(result.voxels.occupied,
                [&](const geometry::Cell& cell) { return !any_contains(options.prisms, result.voxels.center(cell)); });
  result.cloud_points = points.size();
  PointCloud surface = crop_points(options.prisms, sample_surface(mesh, box, options.samples_per_m2));
  surface.positions.insert(surface.positions.end(), points.positions.begin(), points.positions.end());
  surface.normals.insert(surface.normals.end(), points.normals.begin(), points.normals.end());
  result.surface_points = surface.size();
  if (!result.voxels.occupied.empty()) result.quantization_floor_m = center_distances(surface.positions, result.voxels);

  if (!parts.empty()) write_mesh_glb(folder / "mesh.glb", parts, options.textured_mesh, progress);
  constexpr int kFiles = 4;
  report_progress(progress, 0, kFiles, "writing ground truth");
  geometry::write_cloud(folder / "surface.ply", surface);
  report_progress(progress, 1, kFiles, "writing ground truth");
  geometry::write_binvox(folder / "voxels.binvox", result.voxels);
  report_progress(progress, 2, kFiles, "writing ground truth");
  geometry::write_cloud(folder / "voxels.ply", geometry::cell_centers(result.voxels));
  report_progress(progress, 3, kFiles, "writing ground truth");
  write_octree(folder / "octree.bt", result.voxels);
  report_progress(progress, kFiles, kFiles, "writing ground truth");
  return result;
}

GroundTruth read_ground_truth(const std::filesystem::path& folder) {
  GroundTruth truth;
  if (std::filesystem::exists(folder / "mesh.glb")) truth.mesh = read_mesh_glb(folder / "mesh.glb");
  truth.voxel_centers = geometry::read_cloud(folder / "voxels.ply");
  truth.voxel_m = geometry::read_binvox_header(folder / "voxels.binvox").edge_m;
  return truth;
}

geometry::PointCloud read_surface_samples(const std::filesystem::path& folder) {
  return geometry::read_cloud(folder / "surface.ply");
}

}  // namespace tileflight::ground_truth
