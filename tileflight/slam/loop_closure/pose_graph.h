#pragma once

// Pose-graph optimisation over keyframes, which distributes loop errors. Nodes are similarities, since a monocular map
// also drifts in scale (Strasdat, Montiel, Davison, "Scale drift-aware large scale monocular SLAM", RSS 2010, section
// IV). Error of an edge with the measured T_a_b, node poses T_map_a and T_map_b, as a right twist of T_a_b:
//   translation  R_ab^T (R_a^T (t_b - t_a) / s_a - t_ab)      (units of a, axes of b)
//   rotation     log(R_ab^T R_a^T R_b)                        (radians)
//   scale        log(s_b / s_a) - log(s_ab)

#include <vector>

#include "tileflight/core/geometry/decompositions.h"
#include "tileflight/core/geometry/transform.h"

namespace tileflight::loop_closure {

struct PoseGraphEdge {
  int a = 0;  ///< indices of the nodes
  int b = 0;
  geometry::Sim3 T_a_b;
  geometry::Mat7 root_information = geometry::Mat7::Identity();  ///< W with W^T W = inverse of the error's covariance;
                                                                 ///< a zero row: not measured
  bool robust = false;  ///< Cauchy's norm: the more an edge contradicts the others, the less it counts
};

/// Returns W of a covariance of translation (units of a) and rotation, and a variance of the logarithm of the scale;
/// infinite: not measured.
geometry::Mat7 root_information(const geometry::Mat6& pose_covariance, double log_scale_variance);

struct PoseGraphResult {
  std::vector<geometry::Sim3> T_map_node;
  double initial_cost = 0.0;  ///< half the sum of squares, in standard deviations
  double final_cost = 0.0;
  int iterations = 0;
  bool converged = false;
};

/// Optimises all nodes but the first by Levenberg-Marquardt (Ceres, one thread), from the given poses.
PoseGraphResult optimize_pose_graph(const std::vector<geometry::Sim3>& T_map_node,
                                    const std::vector<PoseGraphEdge>& edges);

}  // namespace tileflight::loop_closure
