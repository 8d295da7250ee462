#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "tileflight/core/geometry/point_cloud.h"
#include "tileflight/core/geometry/trajectory.h"
#include "tileflight/core/geometry/triangle_index.h"
#include "tileflight/core/imaging/camera.h"
#include "tileflight/world/ground_truth/center_index.h"
#include "tileflight/world/ground_truth/truth_folder.h"
#include "tileflight/world/place/extract_result.h"

namespace tileflight::scoring {

/// The voxel centres of a truth, of which one part is held in memory at a time, and kept until another is asked for.
class VoxelCenters {
 public:
  /// `truth` must outlive it.
  explicit VoxelCenters(const ground_truth::TruthFolder& truth) : truth_(truth) {}

  /// Returns the distance of each point to the nearest voxel centre, metres; the result does not depend on the parts.
  /// `what` names the points. Throws InputError for points that are not finite, and if either side has none.
  std::vector<double> distances(const geometry::PointCloud& points, const char* what);

 private:
  const ground_truth::CenterIndex& index(std::size_t part);

  const ground_truth::TruthFolder& truth_;
  std::optional<std::size_t> part_;  ///< held in memory
  geometry::PointCloud centers_;
  std::optional<ground_truth::CenterIndex> index_;
};

/// Distances of a map from the true surface.
struct SurfaceMatch {
  std::vector<double> distances_m;         ///< of each point of the map to the surface
  std::vector<geometry::Vec3> directions;  ///< of each chosen point: normal, of any length, of the nearest triangle;
                                           ///< zero if there is none within the limit
};

/// The surface of a truth, of which one part is held in memory at a time (and kept until another is asked for). Results
/// do not depend on the parts: on equal distances, the triangle that comes first in the whole truth is the nearest.
class TruthSurface {
 public:
  /// `truth` must outlive it.
  explicit TruthSurface(const ground_truth::TruthFolder& truth);

  /// Measures the distances of a map's points to the surface. `chosen`: indices of the points whose nearest triangle is
  /// asked for, within `within_m`. Throws InputError.
  SurfaceMatch match(const geometry::PointCloud& map, const std::vector<std::uint32_t>& chosen, double within_m);

  /// Returns evenly distributed samples of the surface inside the region.
  geometry::PointCloud sample(const place::TruthRegion& region, double per_m2);

  /// Returns the samples that a camera sees from at least one of the poses, of which there must be one. Memory grows
  /// with the surface within the camera's range, not with the ground truth.
  geometry::PointCloud sample_seen(const place::TruthRegion& region, double per_m2, const geometry::Trajectory& poses,
                                   const imaging::Camera& camera);

 private:
  const ground_truth::NumberedMesh& mesh(std::size_t part);
  const geometry::TriangleIndex& index(std::size_t part);
  geometry::Box3 bounds();

  const ground_truth::TruthFolder& truth_;
  std::optional<std::size_t> part_;  ///< held in memory
  ground_truth::NumberedMesh mesh_;
  std::optional<geometry::TriangleIndex> index_;
};

}  // namespace tileflight::scoring
