#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include "tileflight/alignment/align_map.h"
#include "tileflight/geometry/geodesy.h"

namespace tileflight::experiment {

/// What a map is aligned to, held together with what it points into: ground truth (a folder that extract() wrote) or a
/// cloud.
struct AlignTarget {
  std::filesystem::path folder;  ///< of the ground truth; empty: a cloud
  geometry::PointCloud cloud;    ///< voxel centres, or the cloud
  geometry::TriangleMesh mesh;
  std::optional<geometry::TriangleIndex> index;  ///< of the mesh, where there is one
  std::optional<geometry::Geodetic> origin;      ///< of the local frame, where the place is on the earth
  std::vector<geometry::Box3> regions;           ///< over which there is truth, at any height; empty: not known

  alignment::AlignmentTarget view() const;
};

/// Throws InputError.
AlignTarget read_align_target(const std::filesystem::path& path);

/// gps.csv in the local frame. Throws InputError.
std::vector<alignment::PositionFix> receiver_positions(const std::filesystem::path& gps_csv,
                                                       const geometry::Geodetic& origin);

/// Positions of true poses, as if a receiver without errors had given them. Throws InputError.
std::vector<alignment::PositionFix> true_positions(const std::filesystem::path& trajectory);

}  // namespace tileflight::experiment
