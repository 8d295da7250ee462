#pragma once

// Pose-graph optimisation over keyframes, which distributes loop errors. Nodes are similarities, since a monocular map
// also drifts in scale (Strasdat, Montiel, Davison, "Scale drift-aware large scale monocular SLAM", RSS 2010, section
// IV). Error of an edge with the measured T_a_b, node poses T_map_a and T_map_b:
//   translation  R_a^T (t_b - t_a) / s_a - t_ab      (units of a)
//   rotation     log(R_ab^T R_a^T R_b)               (radians)
//   scale        log(s_b / s_a) - log(s_ab)

#include <vector>

#include "tileflight/geometry/transform.h"

namespace tileflight::loops {

struct PoseGraphEdge {
  int a = 0;  ///< indices of the nodes
  int b = 0;
  geometry::Sim3 T_a_b;
  double translation_sigma = 1.0;  ///< standard deviation, in units of a
  double rotation_sigma_rad = 1.0;
  double scale_sigma = 1.0;  ///< standard deviation of the logarithm
  bool robust = false;       ///< Huber norm, at two standard deviations
};

struct PoseGraphResult {
  std::vector<geometry::Sim3> T_map_node;
  double initial_cost = 0.0;  ///< half the sum of squares, in standard deviations
  double final_cost = 0.0;
  int iterations = 0;
  bool converged = false;
};

/// Levenberg-Marquardt (Ceres, one thread) over all nodes but the first, from the given poses.
PoseGraphResult optimize_pose_graph(const std::vector<geometry::Sim3>& T_map_node,
                                    const std::vector<PoseGraphEdge>& edges);

}  // namespace tileflight::loops
