#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "tileflight/core/alignment/align_map.h"
#include "tileflight/core/base/progress.h"
#include "tileflight/core/geometry/geodesy.h"
#include "tileflight/evaluation/scoring/map_inputs.h"
#include "tileflight/world/scene/scene.h"

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

/// Returns the part of a ground truth that an alignment needs, given the origin of the local frame; nullopt: all of it.
using AlignReach = std::function<std::optional<geometry::Box3>(const std::optional<geometry::Geodetic>& origin)>;

/// Reads the target of an alignment. Of a ground truth in blocks only those in reach are read, or all if none is.
/// Throws InputError.
AlignTarget read_align_target(const std::filesystem::path& path, const AlignReach& reach = {},
                              const Progress& progress = {});

/// Returns the box within the default viewing range of a map whose start is known. A start by a transform uses the
/// map's path or, without one, its points without outliers; a start by positions uses these. Returns nullopt if the
/// start or regions must be searched.
std::optional<geometry::Box3> reach_of_map(const MapInputs& map, const geometry::PointCloud& cloud,
                                           const alignment::AlignMapOptions& options,
                                           const std::optional<geometry::Geodetic>& origin);

/// Throws InputError if a map cannot be aligned from a start that is taken as it is: next to none of its points is near
/// the target, or all of it is smaller than the largest distance of a correspondence. Its coordinates or units are
/// others.
void require_overlap(const geometry::PointCloud& cloud, const geometry::Sim3& T_local_map, const AlignTarget& target,
                     const alignment::AlignMapOptions& options);

/// Reads gps.csv as positions in the local frame. Throws InputError.
std::vector<alignment::PositionFix> read_receiver_positions(const std::filesystem::path& gps_csv,
                                                            const geometry::Geodetic& origin);

/// Reads the positions of true poses, which count as error-free receiver positions. Throws InputError.
std::vector<alignment::PositionFix> read_true_positions(const std::filesystem::path& trajectory);

/// A ground truth's surface, ready for ray casting and for renderings.
struct TexturedPlace {
  std::unique_ptr<scene::Scene> scene;
  bool textured = false;  ///< a mesh has colours to compare images with
};

/// Reads the mesh files of a ground truth (AlignTarget::mesh_files). A texture is decoded when a ray of an image first
/// meets it; without `with_textures` none is read. Throws InputError.
TexturedPlace read_textured_place(const std::vector<std::filesystem::path>& mesh_files, bool with_textures);

}  // namespace tileflight::scoring
