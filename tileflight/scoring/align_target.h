#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include "tileflight/alignment/align_map.h"
#include "tileflight/geometry/geodesy.h"

namespace tileflight::scoring {

/// The reference of an alignment, owning all data it refers to: ground truth (a folder written by extract()) or a point
/// cloud.
struct AlignTarget {
  std::filesystem::path folder;  ///< ground truth folder; empty: a point cloud
  geometry::PointCloud cloud;    ///< voxel centres, or the point cloud
  geometry::TriangleMesh mesh;
  std::optional<geometry::TriangleIndex> index;  ///< of the mesh, if there is one
  std::optional<geometry::Geodetic> origin;      ///< of the local frame, if the place is georeferenced
  std::vector<geometry::Box3> regions;           ///< areas with ground truth, at any height; empty: unknown

  alignment::AlignmentTarget to_alignment_target() const;
};

/// Throws InputError.
AlignTarget read_align_target(const std::filesystem::path& path);

/// gps.csv in the local frame. Throws InputError.
std::vector<alignment::PositionFix> read_receiver_positions(const std::filesystem::path& gps_csv,
                                                            const geometry::Geodetic& origin);

/// Positions of true poses, treated as error-free receiver positions. Throws InputError.
std::vector<alignment::PositionFix> read_true_positions(const std::filesystem::path& trajectory);

}  // namespace tileflight::scoring
