#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "tileflight/core/geometry/nearest.h"
#include "tileflight/core/geometry/transform.h"

namespace tileflight::alignment {

/// Returns the mean of the points in each occupied grid cell, in the order of the cells.
std::vector<geometry::Vec3> voxel_downsample(const std::vector<geometry::Vec3>& points, double cell_m);

struct DescriptorOptions {
  double radius_m = 10.0;                 ///< of the described neighbourhood
  std::size_t normal_neighbors = 16;      ///< neighbours used for each normal
  std::optional<geometry::Vec3> up = {};  ///< unit direction against gravity, if known; adds histograms relative to it
};

/// Describes the surface around each point, one row per point: histograms over the neighbours, combined with the
/// neighbours' own histograms as in Fast Point Feature Histograms (Rusu, Blodow and Beetz, ICRA 2009). For each pair of
/// points they count the unsigned angles between normals and connecting line, since a sparse map has no outside; with
/// gravity also the neighbour's slope and relative height. Rows are zero for points with fewer than five neighbours
/// with normals. Invariant to translation and rotation (with gravity: rotation about the vertical).
Eigen::MatrixXf compute_surface_descriptors(const std::vector<geometry::Vec3>& points,
                                            const DescriptorOptions& options);

}  // namespace tileflight::alignment
