#pragma once

#include <filesystem>

#include "tileflight/geometry/prism.h"
#include "tileflight/geometry/progress.h"
#include "tileflight/ground_truth/voxelize.h"
#include "tileflight/scene/scene.h"

namespace tileflight::ground_truth {

/// Writes what `tileflight extract` leaves of a region, apart from extract.json: mesh.glb (textured, triangles that
/// meet the box), surface.ply (samples with normals), voxels.binvox, voxels.ply, octree.bt (OctoMap).
struct ExtractOptions {
  double voxel_m = 1.0;
  double samples_per_m2 = 16.0;
  bool textured_mesh = true;
  /// Polygons instead of the whole box: triangles count that meet any of them, points and surface samples that lie in
  /// one, cells whose centre does. Empty: the box.
  std::vector<geometry::Prism> within = {};
};

struct ExtractResult {
  geometry::VoxelGrid voxels;
  std::size_t triangles = 0;  ///< that meet the box
  std::size_t surface_points = 0;
  std::size_t cloud_points = 0;  ///< of the clouds, in the box; they stand behind the samples in surface.ply
  /// Of each point in surface.ply to the nearest voxel centre, metres: what a perfect map scores. Empty where no cell
  /// is occupied.
  std::vector<double> floor_m;
};

/// `clouds`: points that stand for surface where there are no triangles (tiles of a point cloud). They occupy their
/// cells and stand in surface.ply with their normals (zero where they have none). A region of points alone has no
/// mesh.glb.
ExtractResult write_ground_truth(const std::vector<imaging::TexturedMesh>& meshes, const geometry::Box3& box,
                                 const ExtractOptions& options, const std::filesystem::path& folder,
                                 const Progress& progress = {}, const std::vector<geometry::PointCloud>& clouds = {});

/// The parts of a folder that `extract` wrote, for scoring. Positions in the local frame.
struct GroundTruth {
  geometry::TriangleMesh mesh;         ///< mesh.glb; empty where points alone were extracted
  geometry::PointCloud voxel_centers;  ///< voxels.ply
  double voxel_m = 1.0;
};
GroundTruth read_ground_truth(const std::filesystem::path& folder);

/// surface.ply: by far the largest part.
geometry::PointCloud read_surface_samples(const std::filesystem::path& folder);

}  // namespace tileflight::ground_truth
