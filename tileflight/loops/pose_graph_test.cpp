#include "tileflight/loops/pose_graph.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace tileflight::loops::pose_graph_test {
namespace {

using geometry::Sim3;
using geometry::Vec3;
using geometry::Vec7;

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
  for (PoseGraphEdge& edge : chain.edges) edge.rotation_sigma_rad = edge.scale_sigma = 1e-6;
  const PoseGraphResult result = optimize_pose_graph(chain.poses, chain.edges);
  EXPECT_TRUE(result.converged);
  for (int i = 0; i <= 10; ++i) EXPECT_NEAR(result.T_map_node[i].translation.x(), i * (1.0 - 1.1 / 11), 1e-5) << i;
  EXPECT_NEAR(result.final_cost, 0.5 * 11 * 0.1 * 0.1, 1e-5);
}

TEST(PoseGraph, ALoopsContradictionInScaleIsSpreadEvenly) {
  // Positions have no weight (huge standard deviation), so the log scales form an independent chain.
  Chain chain(7, step(1.0), step(7.0, 1.5));
  for (PoseGraphEdge& edge : chain.edges) edge.translation_sigma = 1e6;
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
    const double angle_rad = T_a_b.rotation.angularDistance(edge.T_a_b.rotation);
    sum += 0.5 * ((T_a_b.translation - edge.T_a_b.translation) / edge.translation_sigma).squaredNorm() +
           0.5 * std::pow(angle_rad / edge.rotation_sigma_rad, 2) +
           0.5 * std::pow(std::log(T_a_b.scale / edge.T_a_b.scale) / edge.scale_sigma, 2);
  }
  return sum;
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
    edges.push_back({i, next, nodes[i].inverse() * nodes[next] * noise, 0.5, 0.2, 0.1, false});
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
}  // namespace tileflight::loops::pose_graph_test
