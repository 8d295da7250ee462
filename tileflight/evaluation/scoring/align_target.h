#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <optional>
#include <vector>

#include "tileflight/core/alignment/align_map.h"
#include "tileflight/core/base/progress.h"
#include "tileflight/core/geometry/geodesy.h"
#include "tileflight/evaluation/scoring/map_inputs.h"

namespace tileflight::scoring {

/// The reference of an alignment, owning all data it refers to: ground truth (a folder written by extract()) or a point
/// cloud.
struct AlignTarget {
  std::filesystem::path folder;  ///< ground truth folder; empty: a point cloud
  geometry::PointCloud cloud;    ///< voxel centres, or the point cloud
  geometry::TriangleMesh mesh;
  std::optional<geometry::TriangleIndex> index;   ///< of the mesh, if there is one
  std::optional<geometry::Geodetic> origin;       ///< of the local frame, if the place is georeferenced
  std::vector<geometry::Box3> regions;            ///< areas with ground truth, at any height; empty: unknown
  std::vector<std::filesystem::path> mesh_files;  ///< of the blocks read, or of the whole truth
  std::size_t blocks_read = 1, blocks = 1;        ///< of a truth in blocks

  alignment::AlignmentTarget to_alignment_target() const;
};

/// The part of a truth that an alignment needs, given the origin of the local frame; nullopt: all of it.
using AlignReach = std::function<std::optional<geometry::Box3>(const std::optional<geometry::Geodetic>& origin)>;

/// Of a truth in blocks only those in reach are read, unless nothing is. Throws InputError.
AlignTarget read_align_target(const std::filesystem::path& path, const AlignReach& reach = {},
                              const Progress& progress = {});

/// Everything within the default viewing range of a map whose start is known: from a transform, of its path or (without
/// outliers) of its points; from positions, of these. nullopt if the start is to be found, or regions are.
std::optional<geometry::Box3> reach_of_map(const MapInputs& map, const geometry::PointCloud& cloud,
                                           const alignment::AlignMapOptions& options,
                                           const std::optional<geometry::Geodetic>& origin);

/// gps.csv in the local frame. Throws InputError.
std::vector<alignment::PositionFix> read_receiver_positions(const std::filesystem::path& gps_csv,
                                                            const geometry::Geodetic& origin);

/// Positions of true poses, treated as error-free receiver positions. Throws InputError.
std::vector<alignment::PositionFix> read_true_positions(const std::filesystem::path& trajectory);

}  // namespace tileflight::scoring
