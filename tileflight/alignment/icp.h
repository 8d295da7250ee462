#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/alignment/umeyama.h"
#include "tileflight/geometry/mesh.h"
#include "tileflight/geometry/nearest.h"
#include "tileflight/geometry/point_cloud.h"
#include "tileflight/geometry/triangle_index.h"

namespace tileflight::alignment {

enum class IcpMethod { kPointToPoint, kPointToPlane, kPointToMesh };

/// Defaults are the paper's settings: radius 1 m, RMS change 1e-5, at most 1500 iterations.
struct IcpOptions {
  IcpMethod method = IcpMethod::kPointToPoint;
  double radius_m = 1.0;               ///< correspondences farther apart do not count
  double rms_change_m = 1e-5;          ///< stop when the RMS changes by less from one iteration to the next
  int max_iterations = 1500;
  ScaleMode scale = ScaleMode::kEstimated;
  double max_scale_change = 1.2;       ///< scale stays within [1/x, x] of the start, so that it cannot collapse
  std::vector<geometry::Box3> regions; ///< source points (after the initial transform) inside any of these take part; none: all
};

struct AlignmentResult {
  geometry::Sim3 T_target_source;
  double rmse_m = 0.0;          ///< over the correspondences at the end
  double fitness = 0.0;         ///< share of the source points that take part which have a correspondence
  std::size_t correspondences = 0;
  int iterations = 0;
  bool converged = false;       ///< stop rule met before max_iterations, and checked: no large step is left (see note)
  std::string method;
  std::string note;             ///< empty, or one line: what is doubtful about this result
};

/// Besl and McKay, IEEE TPAMI 14(2), 1992. Throws InputError for empty or non-finite input; no correspondence within the radius is a
/// result with converged = false and a note.
AlignmentResult icp(const geometry::PointCloud& source, const geometry::PointCloud& target,
                    const geometry::Sim3& initial, const IcpOptions& options = {});

/// Against the triangles themselves (nearest point of the surface, point-to-plane step).
AlignmentResult icp(const geometry::PointCloud& source, const geometry::TriangleIndex& target,
                    const geometry::TriangleMesh& target_mesh, const geometry::Sim3& initial, const IcpOptions& options);

}  // namespace tileflight::alignment
