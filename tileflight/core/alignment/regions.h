#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "tileflight/core/geometry/mesh.h"
#include "tileflight/core/geometry/point_cloud.h"

namespace tileflight::alignment {

struct FindRegionsOptions {
  double cell_m = 15.0;          ///< regions are vertical columns with this edge length
  double patch_m = 1.5;          ///< size of the patches on which planarity is measured
  double margin_m = 3.0;         ///< map points up to this far above or below a cell's surface belong to it
  std::size_t min_points = 30;   ///< minimum number of points of each map in a region
  std::size_t max_regions = 24;  ///< maximum number of regions
};

/// A region and the criteria by which it was chosen.
struct FoundRegion {
  geometry::Box3 box;
  double corner_strength = 0.0;  ///< smallest eigenvalue of the mean n n^T of its surface normals: 0 for planes and
                                 ///< edges, at most 1/3
  double planarity = 0.0;        ///< 1: every patch is flat; 0: vegetation
};

/// Regions to align on, and held-out regions: scores there are not affected by the fit.
struct FoundRegions {
  std::vector<FoundRegion> aligned_on;
  std::vector<FoundRegion> held_out;
};

/// Finds regions that constrain an alignment well, such as corners of buildings: planar patches facing at least three
/// directions, with points of every map (all in the surface's frame). Selects the best grid cells by corner_strength *
/// planarity^2 and assigns them alternately along a space-filling curve, so that both lists are spread over the place.
/// Returns none if there are fewer than four such cells, since the result would depend on the choice of two or three.
FoundRegions find_regions(const geometry::TriangleMesh& surface, const std::vector<const geometry::PointCloud*>& maps,
                          const FindRegionsOptions& options = {});

/// Regions that an alignment used, and regions held out for scoring; local frame.
struct RegionList {
  std::vector<geometry::Box3> aligned_on;
  std::vector<geometry::Box3> held_out;
  bool found = false;  ///< by find_regions(); else given by the user
};

/// Converts regions to the key `regions` of transform.json ({found, aligned_on: [{center, size}], held_out: [...]}),
/// and back. Throws InputError
/// (`where`) if the JSON has another form.
nlohmann::json to_json(const RegionList& regions);
RegionList regions_from_json(const nlohmann::json& json, const std::string& where);

}  // namespace tileflight::alignment
