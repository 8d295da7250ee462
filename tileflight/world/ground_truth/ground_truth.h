#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include "tileflight/core/base/progress.h"
#include "tileflight/core/geometry/prism.h"
#include "tileflight/world/ground_truth/mesh_glb.h"
#include "tileflight/world/ground_truth/voxelize.h"
#include "tileflight/world/scene/scene.h"

namespace tileflight::ground_truth {

/// A part of a region's ground truth. Cells, samples and points belong to the block whose cells hold them. A triangle
/// belongs to the block that holds the lowest corner of its bounds (or the point of the region nearest to it). The
/// blocks of a region share nothing and are together exactly what the region has without blocks.
struct GroundTruthBlock {
  CellRange cells;  ///< of the grid of the whole region
  /// Number of cells around the block which the meshes and clouds given cover, too.
  std::int32_t border = 1;
  /// Content of each mesh given, and the number of its first triangle there (`triangles` is ignored). They are stored
  /// with the block's triangles, so that these can be read in the order of the whole region. Empty: not stored.
  std::vector<MeshOrigin> origins = {};
};

/// Options of write_ground_truth(), which writes the output of `tileflight extract` except extract.json: mesh.glb
/// (textured, triangles that intersect the box), surface.ply (samples with normals), voxels.binvox, voxels.ply,
/// octree.bt (OctoMap).
struct GroundTruthOptions {
  double voxel_m = 1.0;
  double samples_per_m2 = 16.0;
  bool textured_mesh = true;
  /// Polygons that restrict the box: keeps triangles that intersect any of them, points and surface samples inside one,
  /// and cells whose centre is. Empty: the whole box.
  std::vector<geometry::Prism> prisms = {};
  /// Writes only this part of the region.
  std::optional<GroundTruthBlock> block = {};
};

/// Result of write_ground_truth().
struct GroundTruthSummary {
  geometry::VoxelGrid voxels;
  std::size_t triangles = 0;  ///< that intersect the box
  std::size_t surface_points = 0;
  std::size_t cloud_points = 0;  ///< points of the clouds inside the box; they follow the samples in surface.ply
  /// Distance of each point in surface.ply to the nearest voxel centre, metres: the errors of a perfect map. Empty if
  /// no cell is occupied.
  std::vector<double> quantization_floor_m;
  /// A voxel beyond the block's border may be nearer to a sample than those inside, so the distances are not exact; no
  /// file was written.
  bool border_too_narrow = false;
};

/// Writes the ground truth of a box into a folder. `clouds`: points that represent surface without triangles (tiles of
/// a point cloud). They occupy their cells and are written to surface.ply with their normals (zero if they have none).
/// A region of points alone has no mesh.glb. A block may be empty: then no file is written. Meshes that are moved in
/// are released as soon as they are written.
GroundTruthSummary write_ground_truth(std::vector<imaging::TexturedMesh> meshes, const geometry::Box3& box,
                                      const GroundTruthOptions& options, const std::filesystem::path& folder,
                                      const Progress& progress = {},
                                      const std::vector<geometry::PointCloud>& clouds = {});

/// Returns the cells of a block's files: `voxels` on a grid of the block alone.
geometry::VoxelGrid grid_of_block(const geometry::VoxelGrid& voxels, const CellRange& block);

}  // namespace tileflight::ground_truth
