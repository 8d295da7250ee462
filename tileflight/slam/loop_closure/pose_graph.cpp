#include "tileflight/slam/loop_closure/pose_graph.h"

#include <ceres/autodiff_cost_function.h>
#include <ceres/loss_function.h>
#include <ceres/manifold.h>
#include <ceres/problem.h>
#include <ceres/rotation.h>
#include <ceres/solver.h>

#include <array>
#include <cassert>
#include <cmath>

namespace tileflight::loop_closure {
namespace {

using geometry::Sim3;
using geometry::Vec7;

/// Node in the solver's parameters; the scale is stored as its logarithm, so that it stays positive.
struct Node {
  Eigen::Quaterniond rotation;
  Eigen::Vector3d translation;
  double log_scale = 0.0;
};

/// Errors of translation, rotation and scale, each over its standard deviation.
class EdgeCost {
 public:
  explicit EdgeCost(const PoseGraphEdge& edge) : edge_(edge) {}

  template <class T>
  bool operator()(const T* q_a, const T* t_a, const T* log_s_a, const T* q_b, const T* t_b, const T* log_s_b,
                  T* error) const {
    using Vector = Eigen::Matrix<T, 3, 1>;
    const Eigen::Map<const Eigen::Quaternion<T>> R_a(q_a), R_b(q_b);
    const Eigen::Map<const Vector> p_a(t_a), p_b(t_b);
    const Eigen::Quaternion<T> R_b_a = edge_.T_a_b.rotation.conjugate().template cast<T>();
    const Vector translation =
        R_b_a * (exp(-*log_s_a) * (R_a.conjugate() * (p_b - p_a)) - edge_.T_a_b.translation.template cast<T>());
    const Eigen::Quaternion<T> turn = R_b_a * (R_a.conjugate() * R_b);
    const std::array<T, 4> wxyz{turn.w(), turn.x(), turn.y(), turn.z()};
    Vector angle;
    ceres::QuaternionToAngleAxis(wxyz.data(), angle.data());
    Eigen::Matrix<T, 7, 1> off;
    off << translation, angle, *log_s_b - *log_s_a - std::log(edge_.T_a_b.scale);
    Eigen::Map<Eigen::Matrix<T, 7, 1>>(error, 7) = edge_.root_information.template cast<T>() * off;
    return true;
  }

 private:
  PoseGraphEdge edge_;
};

Node to_node(const Sim3& T) { return {T.rotation, T.translation, std::log(T.scale)}; }

void add_node(ceres::Problem& problem, Node& node) {
  problem.AddParameterBlock(node.rotation.coeffs().data(), 4, new ceres::EigenQuaternionManifold);
  problem.AddParameterBlock(node.translation.data(), 3);
  problem.AddParameterBlock(&node.log_scale, 1);
}

void add_edge(ceres::Problem& problem, const PoseGraphEdge& edge, std::vector<Node>& nodes) {
  // Root of the mean of seven squared standard deviations, beyond which an edge loses weight. Chosen by hand.
  const double limit = std::sqrt(7.0);
  assert(edge.a >= 0 && edge.b >= 0 && edge.a != edge.b);
  assert(edge.a < static_cast<int>(nodes.size()) && edge.b < static_cast<int>(nodes.size()));
  Node &a = nodes[edge.a], &b = nodes[edge.b];
  problem.AddResidualBlock(new ceres::AutoDiffCostFunction<EdgeCost, 7, 4, 3, 1, 4, 3, 1>(new EdgeCost(edge)),
                           edge.robust ? new ceres::CauchyLoss(limit) : nullptr, a.rotation.coeffs().data(),
                           a.translation.data(), &a.log_scale, b.rotation.coeffs().data(), b.translation.data(),
                           &b.log_scale);
}

ceres::Solver::Options solver_options() {
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
  options.sparse_linear_algebra_library_type = ceres::EIGEN_SPARSE;  // the other libraries sum in an order that depends
                                                                     // on their threads
  options.num_threads = 1;
  options.max_num_iterations = 100;
  options.function_tolerance = 1e-12;
  options.parameter_tolerance = 1e-12;
  options.gradient_tolerance = 1e-12;
  options.logging_type = ceres::SILENT;
  return options;
}

}  // namespace

geometry::Mat7 root_information(const geometry::Mat6& pose_covariance, double log_scale_variance) {
  const geometry::SymmetricEigen eigen = geometry::symmetric_eigen(pose_covariance);
  // Smaller shares of the largest eigenvalue are rounding.
  constexpr double kLeastShare = 1e-12;
  const Eigen::VectorXd values = eigen.values.array().max(kLeastShare * eigen.values.maxCoeff());
  geometry::Mat7 root = geometry::Mat7::Zero();
  root.topLeftCorner<6, 6>() = values.cwiseSqrt().cwiseInverse().asDiagonal() * eigen.vectors.transpose();
  root(6, 6) = std::isinf(log_scale_variance) ? 0.0 : 1.0 / std::sqrt(log_scale_variance);
  return root;
}

PoseGraphResult optimize_pose_graph(const std::vector<Sim3>& T_map_node, const std::vector<PoseGraphEdge>& edges) {
  PoseGraphResult result;
  result.T_map_node = T_map_node;
  if (T_map_node.empty() || edges.empty()) return result;
  std::vector<Node> nodes;
  for (const Sim3& T : T_map_node) nodes.push_back(to_node(T));
  ceres::Problem problem;
  for (Node& node : nodes) add_node(problem, node);
  for (const PoseGraphEdge& edge : edges) add_edge(problem, edge, nodes);
  Node& first = nodes.front();
  for (double* fixed : {first.rotation.coeffs().data(), first.translation.data(), &first.log_scale})
    problem.SetParameterBlockConstant(fixed);
  ceres::Solver::Summary summary;
  ceres::Solve(solver_options(), &problem, &summary);
  for (std::size_t i = 1; i < nodes.size(); ++i)
    result.T_map_node[i] = Sim3(std::exp(nodes[i].log_scale), nodes[i].rotation, nodes[i].translation);
  result.initial_cost = summary.initial_cost;
  result.final_cost = summary.final_cost;
  result.iterations = static_cast<int>(summary.iterations.size());
  result.converged = summary.termination_type == ceres::CONVERGENCE;
  return result;
}

}  // namespace tileflight::loop_closure
