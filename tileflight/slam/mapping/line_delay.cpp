#include "tileflight/slam/mapping/line_delay.h"

#include <algorithm>
#include <cmath>

#include "tileflight/core/geometry/decompositions.h"
#include "tileflight/slam/mapping/host_target_pairs.h"
#include "tileflight/slam/mapping/normal_equations.h"

namespace tileflight::mapping {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int kDelay = 4;  ///< of a LineDelaySystem's unknowns

/// The part of the normal equations that belongs to the delay: its column beside the window's unknowns, points
/// eliminated.
struct DelayColumn {
  VectorXd by_unknowns;
  double H = 0.0;
  double b = 0.0;
};

class DelayColumnBuilder {
 public:
  DelayColumnBuilder(const keyframes::Window& window, const keyframes::Lens& lens,
                     const std::vector<HostTargetPair>& pairs, const std::vector<geometry::Vec6>& velocities)
      : window_(window), lens_(lens), pairs_(pairs), velocities_(velocities) {}

  void add(const PointRef& ref, DelayColumn& column) const {
    const keyframes::ActivePoint& point = window_.keyframes[ref.host].points[ref.index];
    VectorXd rho_by_unknowns = VectorXd::Zero(window_.unknowns());
    double H_rho = 0.0, b_rho = 0.0, delay_by_rho = 0.0;
    for (const keyframes::Observation& observation : point.observations) {
      if (observation.state != keyframes::ResidualState::kGood) continue;
      const HostTargetPair& pair = pairs_[ref.host * window_.size() + observation.target];
      const Eigen::Vector2d by_delay = pixel_by_delay(ref.host, pair, point, observation);
      const Eigen::Vector2d by_rho = observation.linearization.d_pixel_d_rho.cast<double>();
      const Eigen::Vector2d gr = observation.linearization.sums.gr.cast<double>();
      H_rho += by_rho.dot(add_coupling(window_, ref.host, pair, observation, by_rho, rho_by_unknowns));
      b_rho += by_rho.dot(gr);
      const Eigen::Vector2d weighted = add_coupling(window_, ref.host, pair, observation, by_delay, column.by_unknowns);
      delay_by_rho += by_rho.dot(weighted);
      column.H += by_delay.dot(weighted);
      column.b += by_delay.dot(gr);
    }
    constexpr double kLeastInformation = 1e-10;  // as in the normal equations
    if (H_rho < kLeastInformation) return;
    column.by_unknowns -= delay_by_rho / H_rho * rho_by_unknowns;
    column.H -= delay_by_rho * delay_by_rho / H_rho;
    column.b -= delay_by_rho * b_rho / H_rho;
  }

 private:
  /// Rows below the middle one.
  double rows_below(int slot, float row) const {
    return static_cast<double>(row) - 0.5 * (window_.keyframes[slot].pyramid->levels[0].height - 1);
  }

  /// d(pixel)/d(delay); zero where the point is not in the lens's view any more.
  Eigen::Vector2d pixel_by_delay(int host, const HostTargetPair& pair, const keyframes::ActivePoint& point,
                                 const keyframes::Observation& observation) const {
    const keyframes::PairTransform& T = pair.frame.current;
    Eigen::Vector2f pixel;
    if (!lens_.project<float>(T.R * point.patch.ray + point.rho * T.t, pixel)) return Eigen::Vector2d::Zero();
    // M = -Ad(T_target_host) in its first six rows and columns.
    const geometry::Vec6 change =
        rows_below(observation.target, pixel.y()) * velocities_[observation.target] +
        rows_below(host, point.patch.pixel.y()) * (pair.d_relative_d_host.topLeftCorner<6, 6>() * velocities_[host]);
    return observation.linearization.d_pixel_d_pose.cast<double>() * change;
  }

  const keyframes::Window& window_;
  const keyframes::Lens& lens_;
  const std::vector<HostTargetPair>& pairs_;
  const std::vector<geometry::Vec6>& velocities_;
};

/// Eliminates the first `count` unknowns. Those that a monocular window leaves free (its frame, scale and brightness)
/// have no part in the rest; the damping keeps them finite.
LineDelaySystem eliminate(const MatrixXd& H, const VectorXd& b, Eigen::Index count) {
  constexpr double kDamping = 1e-5;  // of a unit diagonal; chosen by hand
  const Eigen::Index rest = H.rows() - count;
  const VectorXd scale = (H.diagonal().head(count).array().max(0.0) + 10.0).sqrt().inverse();
  MatrixXd poses = scale.asDiagonal() * H.topLeftCorner(count, count) * scale.asDiagonal();
  poses.diagonal().array() += kDamping;
  const MatrixXd coupling = scale.asDiagonal() * H.topRightCorner(count, rest);
  const MatrixXd solved = geometry::symmetric_inverse(poses) * coupling;
  LineDelaySystem out;
  const Eigen::Index from = LineDelaySystem::Vec5::SizeAtCompileTime - rest;  // without intrinsics: the delay alone
  out.H.bottomRightCorner(rest, rest) = H.bottomRightCorner(rest, rest) - coupling.transpose() * solved;
  out.b.segment(from, rest) = b.tail(rest) - solved.transpose() * scale.cwiseProduct(b.head(count));
  return out;
}

struct Solution {
  double delay_s = 0.0;
  double variance = 0.0;  ///< if a residual's variance were 1, and all independent
};

Solution solve(const LineDelaySystem& system, const Eigen::Matrix4d& intrinsics) {
  MatrixXd H = system.H;
  H.topLeftCorner<4, 4>() += intrinsics;
  const VectorXd scale = (H.diagonal().array().max(0.0) + 1e-9).sqrt().inverse();
  H = scale.asDiagonal() * H * scale.asDiagonal();
  H.diagonal().array() += 1e-12;
  const MatrixXd inverse = scale.asDiagonal() * geometry::symmetric_inverse(H) * scale.asDiagonal();
  return {-inverse.row(kDelay).dot(system.b), inverse(kDelay, kDelay)};
}

}  // namespace

LineDelaySystem line_delay_system(keyframes::Window window, const keyframes::Lens& lens,
                                  const std::vector<geometry::Vec6>& velocities) {
  const std::vector<HostTargetPair> pairs = make_host_target_pairs(window);
  const std::vector<PointRef> points = all_points(window);
  const NormalEquations system = build_normal_equations(window, pairs, points, 0.0);
  DelayColumn column{VectorXd::Zero(system.b.size())};
  const DelayColumnBuilder builder(window, lens, pairs, velocities);
  for (const PointRef& ref : points) builder.add(ref, column);
  const Eigen::Index n = system.b.size();
  MatrixXd H(n + 1, n + 1);
  H << system.H, column.by_unknowns, column.by_unknowns.transpose(), column.H;
  VectorXd b(n + 1);
  b << system.b, column.b;
  LineDelaySystem out = eliminate(H, b, 8 * window.size());
  out.b -= out.H.leftCols<4>() * window.intrinsics.value();  // b was relative to the present intrinsics
  return out;
}

std::optional<LineDelayEstimate> estimate_line_delay(const std::vector<LineDelaySystem>& windows,
                                                     const Eigen::Matrix4d& intrinsics) {
  constexpr std::size_t kLeastBlocks = 5, kMostBlocks = 16, kWindows = 2;  // at least so many a block; chosen by hand
  const std::size_t blocks = std::min(kMostBlocks, windows.size() / kWindows);
  if (blocks < kLeastBlocks) return std::nullopt;
  LineDelaySystem all;
  std::vector<LineDelaySystem> parts(blocks);
  for (std::size_t i = 0; i < windows.size(); ++i) {
    parts[i * blocks / windows.size()] += windows[i];
    all += windows[i];
  }
  const Solution best = solve(all, intrinsics);
  std::vector<double> without;
  double mean = 0.0;
  for (const LineDelaySystem& part : parts) {
    LineDelaySystem rest = all;
    rest.H -= part.H;
    rest.b -= part.b;
    without.push_back(solve(rest, intrinsics).delay_s);
    mean += without.back() / static_cast<double>(blocks);
  }
  double squares = 0.0;
  for (const double value : without) squares += (value - mean) * (value - mean);
  const double sigma = std::sqrt(squares * static_cast<double>(blocks - 1) / static_cast<double>(blocks));
  return LineDelayEstimate{best.delay_s, sigma, static_cast<int>(windows.size())};
}

}  // namespace tileflight::mapping
