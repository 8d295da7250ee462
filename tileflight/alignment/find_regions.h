#pragma once

#include <vector>

#include "tileflight/geometry/mesh.h"
#include "tileflight/geometry/point_cloud.h"

namespace tileflight::alignment {

struct FindRegionsOptions {
  double cell_m = 15.0;           ///< regions are columns of this edge length
  double patch_m = 1.5;           ///< over which a surface counts as planar
  double margin_m = 3.0;          ///< map points this far above or below a cell's surface still belong to it
  std::size_t least_points = 30;  ///< of each map in a region
  std::size_t most = 24;          ///< regions at most
};

/// A part of a place, and why it was taken.
struct FoundRegion {
  geometry::Box3 box;
  double corners = 0.0;    ///< least eigenvalue of the mean n n^T of its surface: 0 for planes and edges, at most 1/3
  double planarity = 0.0;  ///< 1: every patch is flat; 0: leaves
};

/// Regions to align on, and others that are kept back: what is scored there was not fitted.
struct FoundRegions {
  std::vector<FoundRegion> aligning;
  std::vector<FoundRegion> held_out;
};

/// Parts of a surface that hold an alignment firmly, as a person would pick buildings' corners: planar patches that
/// look in three directions at least, with points of every map (all in the surface's frame). The best cells of a grid
/// by corners * planarity^2, dealt out in turn along a space-filling curve, so that both lists are spread over the
/// place. Fewer than four such cells give none: a choice of two or three would hang on them.
FoundRegions find_regions(const geometry::TriangleMesh& surface, const std::vector<const geometry::PointCloud*>& maps,
                          const FindRegionsOptions& options = {});

}  // namespace tileflight::alignment
