#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "tileflight/core/geometry/mesh.h"
#include "tileflight/core/geometry/point_cloud.h"
#include "tileflight/world/ground_truth/mesh_glb.h"

namespace tileflight::ground_truth {

/// The parts of a folder written by `extract` that scoring needs. Positions in the local frame.
struct GroundTruth {
  geometry::TriangleMesh mesh;         ///< mesh.glb; empty if only points were extracted
  geometry::PointCloud voxel_centers;  ///< voxels.ply
  double voxel_m = 1.0;
};

/// Reads a folder written by `extract` in parts: its blocks, as index.json names them, or the whole if there are none.
/// Data merged from several parts are in the order that they have without blocks.
class TruthFolder {
 public:
  /// Reads index.json and the heads of the blocks' meshes. Throws InputError.
  explicit TruthFolder(std::filesystem::path folder);

  std::size_t size() const { return parts_.size(); }
  const std::filesystem::path& folder() const { return folder_; }
  const std::filesystem::path& folder_of(std::size_t part) const { return parts_[part].folder; }
  /// Edge of the voxels, from voxels.binvox. Throws InputError.
  double voxel_m() const;
  bool has_mesh(std::size_t part) const { return parts_[part].has_mesh; }
  bool has_mesh() const;

  /// Returns the bounds of a part's triangles, which may reach beyond the block; empty: it has none. A ground truth
  /// without blocks is taken to reach everywhere.
  const geometry::Box3& mesh_bounds(std::size_t part) const { return parts_[part].mesh_bounds; }
  /// Returns the bounds of a part's voxels, likewise.
  const geometry::Box3& voxel_bounds(std::size_t part) const { return parts_[part].voxel_bounds; }

  /// Throw InputError.
  NumberedMesh read_mesh(std::size_t part) const;
  geometry::PointCloud read_voxel_centers(std::size_t part) const;

  /// Reads all triangles of these parts.
  geometry::TriangleMesh read_meshes(const std::vector<std::size_t>& parts) const;
  /// Reads all voxel centres of these parts.
  geometry::PointCloud read_voxel_centers(const std::vector<std::size_t>& parts) const;
  /// Reads surface.ply, by far the largest file, of all parts.
  geometry::PointCloud read_surface_samples() const;

  /// Returns the parts that may hold triangles or voxels in a box, ascending.
  std::vector<std::size_t> parts_in(const geometry::Box3& box) const;
  std::vector<std::size_t> all_parts() const;

 private:
  struct Part {
    std::filesystem::path folder;
    bool has_mesh = false;
    geometry::Box3 mesh_bounds, voxel_bounds;
  };

  void read_index(const std::filesystem::path& index);

  std::filesystem::path folder_;
  std::vector<Part> parts_;
};

/// Merges parts of a mesh, given in any sequence; the triangles are in the order of the whole.
geometry::TriangleMesh merge_in_order(const std::vector<NumberedMesh>& parts);

/// Reads the ground truth of a folder, all blocks together. Throws InputError.
GroundTruth read_ground_truth(const std::filesystem::path& folder);

/// Reads the surface samples of a folder, as TruthFolder::read_surface_samples().
geometry::PointCloud read_surface_samples(const std::filesystem::path& folder);

}  // namespace tileflight::ground_truth
