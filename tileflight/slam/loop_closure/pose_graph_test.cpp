#include "tileflight/slam/loop_closure/pose_graph.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace tileflight::loop_closure::pose_graph_test {
namespace {

using geometry::Sim3;
using geometry::Vec3;
using geometry::Vec7;

/// W of independent errors with these standard deviations.
geometry::Mat7 independent(double translation, double rotation_rad, double log_scale) {
  geometry::Vec6 variance;
  variance << Vec3::Constant(translation * translation), Vec3::Constant(rotation_rad * rotation_rad);
  return root_information(variance.asDiagonal(), log_scale * log_scale);
}

Sim3 step(double length, double scale = 1.0) { return {scale, Eigen::Quaterniond::Identity(), Vec3(length, 0, 0)}; }

/// A chain of `count` equal steps and a loop edge from its first node to its last.
struct Chain {
  std::vector<Sim3> poses{Sim3()};
  std::vector<PoseGraphEdge> edges;

  Chain(int count, const Sim3& one, const Sim3& loop) {
    for (int i = 0; i < count; ++i) {
      poses.push_back(poses.back() * one);
      edges.push_back({.a = i, .b = i + 1, .T_a_b = one});
    }
    edges.push_back({.a = 0, .b = count, .T_a_b = loop});
  }
};

TEST(PoseGraph, ALoopsContradictionInPositionIsSpreadEvenly) {
  // With rotation and scale fixed, least squares over 10 steps and the loop, each of weight one, moves each of the
  // eleven edges by an eleventh of the loop error.
  Chain chain(10, step(1.0), step(8.9));
  for (PoseGraphEdge& edge : chain.edges) edge.root_information = independent(1.0, 1e-6, 1e-6);
  const PoseGraphResult result = optimize_pose_graph(chain.poses, chain.edges);
  EXPECT_TRUE(result.converged);
  for (int i = 0; i <= 10; ++i) EXPECT_NEAR(result.T_map_node[i].translation.x(), i * (1.0 - 1.1 / 11), 1e-5) << i;
  EXPECT_NEAR(result.final_cost, 0.5 * 11 * 0.1 * 0.1, 1e-5);
}

TEST(PoseGraph, ALoopsContradictionInScaleIsSpreadEvenly) {
  // Positions have no weight (huge standard deviation), so the log scales form an independent chain.
  Chain chain(7, step(1.0), step(7.0, 1.5));
  for (PoseGraphEdge& edge : chain.edges) edge.root_information = independent(1e6, 1.0, 1.0);
  const PoseGraphResult result = optimize_pose_graph(chain.poses, chain.edges);
  EXPECT_TRUE(result.converged);
  for (int i = 0; i <= 7; ++i) EXPECT_NEAR(result.T_map_node[i].scale, std::pow(1.5, i / 8.0), 1e-6) << i;
}

Sim3 random_sim3(std::mt19937& random) {
  std::uniform_real_distribution<double> u(-1.0, 1.0);
  const Vec3 turn(u(random), u(random), u(random));
  const Vec3 place(3 * u(random), 3 * u(random), 3 * u(random));
  return {std::exp(0.5 * u(random)), geometry::so3_exp(turn), place};
}

TEST(PoseGraph, RecoversAnyConsistentGraphAndHoldsItsFirstNode) {
  std::mt19937 random(4);
  std::vector<Sim3> truth, start;
  for (int i = 0; i < 8; ++i) truth.push_back(random_sim3(random));
  std::vector<PoseGraphEdge> edges;
  for (int i = 0; i < 8; ++i) {
    for (int j : {i + 1, i + 3}) {
      if (j < 8) edges.push_back({.a = i, .b = j, .T_a_b = truth[i].inverse() * truth[j]});
    }
    const Sim3 off(1.1, geometry::so3_exp(Vec3(0.1, -0.1, 0.05 * i)), Vec3(0.2, -0.1 * i, 0.1));
    start.push_back(i == 0 ? truth[0] : truth[i] * off);
  }
  const PoseGraphResult result = optimize_pose_graph(start, edges);
  EXPECT_TRUE(result.converged);
  EXPECT_LT(result.final_cost, 1e-12 * result.initial_cost);
  EXPECT_EQ(result.T_map_node[0].translation, truth[0].translation);
  for (int i = 0; i < 8; ++i) EXPECT_LT((result.T_map_node[i].matrix() - truth[i].matrix()).norm(), 1e-6) << i;
}

double cost(const std::vector<Sim3>& nodes, const std::vector<PoseGraphEdge>& edges) {
  double sum = 0;
  for (const PoseGraphEdge& edge : edges) {
    const Sim3 T_a_b = nodes[edge.a].inverse() * nodes[edge.b];
    Vec7 off;
    off << edge.T_a_b.rotation.conjugate() * (T_a_b.translation - edge.T_a_b.translation),
        geometry::so3_log(edge.T_a_b.rotation.conjugate() * T_a_b.rotation), std::log(T_a_b.scale / edge.T_a_b.scale);
    sum += 0.5 * (edge.root_information * off).squaredNorm();
  }
  return sum;
}

/// Errors of translation and rotation that depend on each other.
geometry::Mat7 any_root(std::mt19937& random) {
  std::uniform_real_distribution<double> u(-1.0, 1.0);
  geometry::Mat6 A;
  for (double& entry : A.reshaped()) entry = 0.3 * u(random);
  return root_information(A * A.transpose() + 0.01 * geometry::Mat6::Identity(), 0.01);
}

TEST(PoseGraph, TheRootOfAnInformationIsThatOfTheInverse) {
  std::mt19937 random(2);
  geometry::Mat6 A;
  std::uniform_real_distribution<double> u(-1.0, 1.0);
  for (double& entry : A.reshaped()) entry = u(random);
  const geometry::Mat6 covariance = A * A.transpose() + 0.1 * geometry::Mat6::Identity();
  const geometry::Mat7 W = root_information(covariance, 4.0), information = W.transpose() * W;
  EXPECT_LT((information.topLeftCorner<6, 6>() * covariance - geometry::Mat6::Identity()).norm(), 1e-9);
  EXPECT_NEAR(information(6, 6), 0.25, 1e-12);
  EXPECT_EQ(root_information(covariance, HUGE_VAL)(6, 6), 0.0);
}

TEST(PoseGraph, NoDirectionLeadsFurtherDownFromTheSolution) {
  // Numeric derivatives of the cost by every unknown vanish at the solution found with analytic ones.
  std::mt19937 random(9);
  std::vector<Sim3> nodes;
  for (int i = 0; i < 6; ++i) nodes.push_back(random_sim3(random));
  std::vector<PoseGraphEdge> edges;
  for (int i = 0; i < 6; ++i) {
    const Sim3 noise(1.03 - 0.01 * i, geometry::so3_exp(Vec3(0.02, 0.03 * i, -0.02)), Vec3(0.05 * i, 0.1, -0.1));
    const int next = (i + 1) % 6;
    edges.push_back({i, next, nodes[i].inverse() * nodes[next] * noise, any_root(random), false});
  }
  const PoseGraphResult result = optimize_pose_graph(nodes, edges);
  EXPECT_TRUE(result.converged);
  EXPECT_NEAR(result.final_cost, cost(result.T_map_node, edges), 1e-9);
  EXPECT_LT(result.final_cost, result.initial_cost);
  for (int node = 1; node < 6; ++node) {
    for (int k = 0; k < 7; ++k) {
      const auto moved = [&](double by) {
        std::vector<Sim3> out = result.T_map_node;
        Vec7 d = Vec7::Zero();
        d[k] = by;
        out[node] = out[node] * Sim3(std::exp(d[6]), geometry::so3_exp(d.segment<3>(3)), d.head<3>());
        return cost(out, edges);
      };
      constexpr double kStep = 1e-4;
      EXPECT_NEAR((moved(kStep) - moved(-kStep)) / (2 * kStep), 0.0, 1e-4 * result.initial_cost) << node << " " << k;
    }
  }
}

}  // namespace
}  // namespace tileflight::loop_closure::pose_graph_test
