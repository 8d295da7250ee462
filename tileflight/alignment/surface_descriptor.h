#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "tileflight/geometry/nearest.h"
#include "tileflight/geometry/transform.h"

namespace tileflight::alignment {

/// Points thinned to one mean for each occupied cell of a grid, in the order of the cells.
std::vector<geometry::Vec3> thinned_to_grid(const std::vector<geometry::Vec3>& points, double cell_m);

struct DescriptorOptions {
  double radius_m = 10.0;                 ///< of the neighbourhood that is described
  std::size_t normal_neighbors = 16;      ///< of each point's normal
  std::optional<geometry::Vec3> up = {};  ///< unit length; where gravity is known, it is described too
};

/// What the surface around each point looks like, one row each: histograms over the neighbours, weighted once more over
/// the neighbours' own histograms as Fast Point Feature Histograms are (Rusu, Blodow and Beetz, ICRA 2009). Of a pair
/// of points they count the angles between normals and connecting line without their signs, since a sparse map does not
/// say which side of it is outside; with gravity also the neighbour's steepness and whether it lies higher or lower.
/// Rows are zero where a point has fewer than five neighbours with normals. Does not change with rotation (about the
/// vertical, with gravity) and translation.
Eigen::MatrixXf surface_descriptors(const std::vector<geometry::Vec3>& points, const DescriptorOptions& options);

}  // namespace tileflight::alignment
