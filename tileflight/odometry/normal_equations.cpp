#include "tileflight/odometry/normal_equations.h"

#include <tbb/parallel_for.h>

#include <algorithm>

namespace tileflight::odometry {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr std::size_t kChunk = 128;        ///< points a task
constexpr double kMinInformation = 1e-10;  ///< of rho: below it a point says nothing

/// Sums of one pair in relative unknowns.
struct PairSums {
  Mat8 H = Mat8::Zero();
  Vec8 b = Vec8::Zero();
};

void add_residual(const Linearization& lin, PairSums& sums) {
  using Mat6 = Eigen::Matrix<float, 6, 6>;
  const auto& G = lin.pixel_by_pose;
  const Eigen::Matrix<float, 2, 6> ggG = lin.sums.gg * G;
  const Mat6 pose = G.transpose() * ggG;
  const Eigen::Matrix<float, 6, 2> mixed = G.transpose() * lin.sums.gA;
  const Eigen::Matrix<float, 6, 1> b = G.transpose() * lin.sums.gr;
  sums.H.topLeftCorner<6, 6>() += pose.cast<double>();
  sums.H.topRightCorner<6, 2>() += mixed.cast<double>();
  sums.H.bottomRightCorner<2, 2>() += lin.sums.AA.cast<double>();
  sums.b.head<6>() += b.cast<double>();
  sums.b.tail<2>() += lin.sums.Ar.cast<double>();
}

/// Sums of some points: by pair, and what their elimination takes away.
struct ChunkSums {
  std::vector<PairSums> pairs;
  MatrixXd H_schur;  ///< upper triangle
  VectorXd b_schur;
};

class Builder {
 public:
  Builder(Window& window, const std::vector<Pair>& pairs, double rho_damping)
      : window_(window), pairs_(pairs), n_(window.size()), damping_(1.0 + rho_damping) {}

  ChunkSums sum(const std::vector<PointRef>& points, std::size_t begin, std::size_t end) const {
    ChunkSums sums{std::vector<PairSums>(pairs_.size()), MatrixXd::Zero(8 * n_, 8 * n_), VectorXd::Zero(8 * n_)};
    for (std::size_t i = begin; i < end; ++i) add_point(points[i], sums);
    return sums;
  }

  NormalEquations assemble(const std::vector<ChunkSums>& chunks) const {
    NormalEquations system{MatrixXd::Zero(8 * n_, 8 * n_), VectorXd::Zero(8 * n_)};
    std::vector<PairSums> total(pairs_.size());
    for (const ChunkSums& chunk : chunks) {
      for (std::size_t p = 0; p < total.size(); ++p) {
        total[p].H += chunk.pairs[p].H;
        total[p].b += chunk.pairs[p].b;
      }
      system.H -= chunk.H_schur;
      system.b -= chunk.b_schur;
    }
    system.H.triangularView<Eigen::StrictlyLower>() = system.H.transpose();
    for (int host = 0; host < n_; ++host) {
      for (int target = 0; target < n_; ++target) {
        if (host != target) add_pair(total[host * n_ + target], host, target, system);
      }
    }
    return system;
  }

 private:
  void add_point(const PointRef& ref, ChunkSums& sums) const {
    ActivePoint& point = window_.keyframes[ref.host].points[ref.index];
    VectorXd coupling = VectorXd::Zero(8 * n_);
    double H_rho_rho = 0, b_rho = 0;
    for (const Observation& observation : point.observations) {
      if (observation.state != ResidualState::kGood) continue;
      const int p = ref.host * n_ + observation.target;
      add_residual(observation.linearization, sums.pairs[p]);
      const RelativeTerms terms = relative_terms(observation.linearization);
      coupling.segment<8>(8 * observation.target) += terms.H_rho;
      coupling.segment<8>(8 * ref.host).noalias() += pairs_[p].relative_by_host.transpose() * terms.H_rho;
      H_rho_rho += terms.H_rho_rho;
      b_rho += terms.b_rho;
    }
    point.information = static_cast<float>(H_rho_rho);
    if (H_rho_rho < kMinInformation) return;
    const double inverse = 1.0 / (H_rho_rho * damping_);
    sums.H_schur.selfadjointView<Eigen::Upper>().rankUpdate(coupling, inverse);
    sums.b_schur += coupling * (inverse * b_rho);
  }

  void add_pair(const PairSums& sums, int host, int target, NormalEquations& system) const {
    const Mat8 H = sums.H.selfadjointView<Eigen::Upper>();
    const Mat8& M = pairs_[host * n_ + target].relative_by_host;
    const Mat8 HM = H * M;
    system.H.block<8, 8>(8 * target, 8 * target) += H;
    system.H.block<8, 8>(8 * target, 8 * host) += HM;
    system.H.block<8, 8>(8 * host, 8 * target) += HM.transpose();
    system.H.block<8, 8>(8 * host, 8 * host) += M.transpose() * HM;
    system.b.segment<8>(8 * target) += sums.b;
    system.b.segment<8>(8 * host) += M.transpose() * sums.b;
  }

  Window& window_;
  const std::vector<Pair>& pairs_;
  int n_;
  double damping_;
};

}  // namespace

Eigen::Matrix<double, 6, 6> adjoint(const SE3& T) {
  const geometry::Mat3 R = T.rotation.toRotationMatrix();
  Eigen::Matrix<double, 6, 6> A = Eigen::Matrix<double, 6, 6>::Zero();
  A.topLeftCorner<3, 3>() = R;
  A.bottomRightCorner<3, 3>() = R;
  A.topRightCorner<3, 3>() = geometry::skew(T.translation) * R;
  return A;
}

std::vector<Pair> make_pairs(const Window& window) {
  const int n = window.size();
  std::vector<SE3> poses, inverses;
  for (const Keyframe& keyframe : window.keyframes) {
    poses.push_back(keyframe.T_camera_map());
    inverses.push_back(poses.back().inverse());
  }
  std::vector<Pair> pairs(static_cast<std::size_t>(n) * n);
  for (int h = 0; h < n; ++h) {
    const Keyframe& host = window.keyframes[h];
    for (int t = 0; t < n; ++t) {
      if (h == t) continue;
      const Keyframe& target = window.keyframes[t];
      Pair& pair = pairs[h * n + t];
      pair.frame.current = pair_transform(poses[t] * inverses[h], host.light(), target.light());
      const SE3 T_linear = target.T_camera_map_linear * host.T_camera_map_linear.inverse();
      const double gain = std::exp(target.light_linear.a - host.light_linear.a);
      pair.frame.R_linear = T_linear.rotation.toRotationMatrix().cast<float>();
      pair.frame.t_linear = T_linear.translation.cast<float>();
      pair.frame.gain_linear = static_cast<float>(gain);
      pair.frame.host_b_linear = static_cast<float>(host.light_linear.b);
      pair.relative_by_host.topLeftCorner<6, 6>() = -adjoint(T_linear);
      pair.relative_by_host(6, 6) = -1.0;
      pair.relative_by_host(7, 7) = -gain;
    }
  }
  return pairs;
}

RelativeTerms relative_terms(const Linearization& lin) {
  RelativeTerms terms;
  const Eigen::Vector2f gg_rho = lin.sums.gg * lin.pixel_by_rho;
  terms.H_rho.head<6>() = (lin.pixel_by_pose.transpose() * gg_rho).cast<double>();
  terms.H_rho.tail<2>() = (lin.sums.gA.transpose() * lin.pixel_by_rho).cast<double>();
  terms.H_rho_rho = lin.pixel_by_rho.dot(gg_rho);
  terms.b_rho = lin.pixel_by_rho.dot(lin.sums.gr);
  return terms;
}

std::vector<PointRef> all_points(const Window& window) {
  std::vector<PointRef> refs;
  for (int host = 0; host < window.size(); ++host) {
    for (int i = 0; i < static_cast<int>(window.keyframes[host].points.size()); ++i) refs.push_back({host, i});
  }
  return refs;
}

NormalEquations build_normal_equations(Window& window, const std::vector<Pair>& pairs,
                                       const std::vector<PointRef>& points, double rho_damping) {
  const Builder builder(window, pairs, rho_damping);
  const std::size_t chunks = (points.size() + kChunk - 1) / kChunk;
  std::vector<ChunkSums> sums(chunks);
  tbb::parallel_for(std::size_t{0}, chunks, [&](std::size_t c) {
    sums[c] = builder.sum(points, c * kChunk, std::min(points.size(), (c + 1) * kChunk));
  });
  return builder.assemble(sums);
}

void back_substitute(Window& window, const std::vector<Pair>& pairs, const std::vector<PointRef>& points,
                     const VectorXd& x, double rho_damping) {
  const int n = window.size();
  std::vector<Vec8> relative_step(pairs.size(), Vec8::Zero());
  for (int h = 0; h < n; ++h) {
    for (int t = 0; t < n; ++t) {
      if (h == t) continue;
      relative_step[h * n + t] = x.segment<8>(8 * t) + pairs[h * n + t].relative_by_host * x.segment<8>(8 * h);
    }
  }
  for (const PointRef& ref : points) {
    ActivePoint& point = window.keyframes[ref.host].points[ref.index];
    double H = 0, b = 0;
    for (const Observation& observation : point.observations) {
      if (observation.state != ResidualState::kGood) continue;
      const RelativeTerms terms = relative_terms(observation.linearization);
      H += terms.H_rho_rho;
      b += terms.b_rho + terms.H_rho.dot(relative_step[ref.host * n + observation.target]);
    }
    point.step = H < kMinInformation ? 0.0F : static_cast<float>(-b / (H * (1.0 + rho_damping)));
  }
}

VectorXd stacked_delta(const Window& window) {
  VectorXd delta(8 * window.size());
  for (int i = 0; i < window.size(); ++i) delta.segment<8>(8 * i) = window.keyframes[i].delta;
  return delta;
}

}  // namespace tileflight::odometry
