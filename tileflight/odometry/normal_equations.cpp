#include "tileflight/odometry/normal_equations.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cassert>
#include <cstdint>

#include "tileflight/odometry/lanes.h"

namespace tileflight::odometry {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr std::size_t kChunk = 16;         ///< points a task; so few that floats may add up
constexpr float kMinInformation = 1e-10F;  ///< of rho: below it a point says nothing

/// Lanes in a std::vector: the compiler's vector type itself is not always allocated as it must be aligned.
struct alignas(sizeof(Lanes)) Row {
  Lanes lanes{};
};

/// A residual in relative unknowns, one lane each. With x, y: the pixel's derivatives by pose (lanes 0 to 5), and p, q:
/// sums of gradient times derivative by the light (lanes 6, 7), row i of its matrix is
///   (gg_00 x_i + gg_01 y_i) x + (gg_01 x_i + gg_11 y_i) y + x_i p + y_i q.
struct RelativeLanes {
  Lanes x{}, y{}, p{}, q{};

  explicit TILEFLIGHT_LANE_INLINE RelativeLanes(const Linearization& lin) {
    for (int i = 0; i < 6; ++i) {
      x[i] = lin.pixel_by_pose(0, i);
      y[i] = lin.pixel_by_pose(1, i);
    }
    for (int i = 0; i < 2; ++i) {
      p[6 + i] = lin.sums.gA(0, i);
      q[6 + i] = lin.sums.gA(1, i);
    }
  }
};

/// Sums of one pair in relative unknowns; rows of which the right part counts (upper triangle).
struct alignas(sizeof(Lanes)) PairSums {
  std::array<Lanes, 8> H{};
  Lanes b{};
};

constexpr int kLensUnknowns = 4;

/// Sums of one pair with the lens's unknowns, in the first four lanes of each row.
struct alignas(sizeof(Lanes)) LensSums {
  std::array<Lanes, 8> by_relative{};  ///< a row for each relative unknown
  std::array<Lanes, kLensUnknowns> H{};
  Lanes b{};
};

/// Derivatives of a residual's pixel by the lens.
struct LensLanesOf {
  Lanes x{}, y{};

  explicit TILEFLIGHT_LANE_INLINE LensLanesOf(const Linearization& lin) {
    for (int i = 0; i < kLensUnknowns; ++i) {
      x[i] = lin.pixel_by_lens(0, i);
      y[i] = lin.pixel_by_lens(1, i);
    }
  }
};

TILEFLIGHT_LANE_INLINE void add_lens(const Linearization& lin, const RelativeLanes& r, const LensLanesOf& lens,
                                     LensSums& sums) {
  const Eigen::Matrix2f& gg = lin.sums.gg;
  const Lanes gradient_x = gg(0, 0) * lens.x + gg(0, 1) * lens.y, gradient_y = gg(0, 1) * lens.x + gg(1, 1) * lens.y;
  for (int i = 0; i < 6; ++i) sums.by_relative[i] += r.x[i] * gradient_x + r.y[i] * gradient_y;
  for (int i = 0; i < 2; ++i) sums.by_relative[6 + i] += lin.sums.gA(0, i) * lens.x + lin.sums.gA(1, i) * lens.y;
  for (int i = 0; i < kLensUnknowns; ++i) sums.H[i] += lens.x[i] * gradient_x + lens.y[i] * gradient_y;
  sums.b += lin.sums.gr[0] * lens.x + lin.sums.gr[1] * lens.y;
}

/// Of a residual: what couples the lens with rho.
TILEFLIGHT_LANE_INLINE void rho_lens_coupling(const Linearization& lin, const LensLanesOf& lens, Lanes& coupling) {
  const Eigen::Vector2f gg_rho = lin.sums.gg * lin.pixel_by_rho;
  coupling = gg_rho[0] * lens.x + gg_rho[1] * lens.y;
}

TILEFLIGHT_LANE_INLINE void add_residual(const Linearization& lin, const RelativeLanes& r, PairSums& sums) {
  const Eigen::Matrix2f& gg = lin.sums.gg;
  for (int i = 0; i < 6; ++i) {
    const float along_x = gg(0, 0) * r.x[i] + gg(0, 1) * r.y[i], along_y = gg(0, 1) * r.x[i] + gg(1, 1) * r.y[i];
    sums.H[i] += along_x * r.x + along_y * r.y + r.x[i] * r.p + r.y[i] * r.q;
  }
  Lanes b = lin.sums.gr[0] * r.x + lin.sums.gr[1] * r.y;
  for (int i = 0; i < 2; ++i) {
    b[6 + i] = lin.sums.Ar[i];
    for (int j = i; j < 2; ++j) sums.H[6 + i][6 + j] += lin.sums.AA(i, j);
  }
  sums.b += b;
}

/// Of a residual: what couples its relative unknowns with rho.
TILEFLIGHT_LANE_INLINE void rho_coupling(const Linearization& lin, const RelativeLanes& r, Lanes& coupling) {
  const Eigen::Vector2f gg_rho = lin.sums.gg * lin.pixel_by_rho;
  coupling = gg_rho[0] * r.x + gg_rho[1] * r.y + lin.pixel_by_rho[0] * r.p + lin.pixel_by_rho[1] * r.q;
}

/// A pair's relative_by_host by rows.
struct alignas(sizeof(Lanes)) HostRows {
  std::array<Lanes, 8> rows{};
};

HostRows host_rows(const Mat8& relative_by_host) {
  HostRows out;
  for (int i = 0; i < 8; ++i) {
    for (int j = 0; j < 8; ++j) out.rows[i][j] = static_cast<float>(relative_by_host(i, j));
  }
  return out;
}

/// Some points of one host, one after the other.
struct Chunk {
  int host = 0;
  std::size_t begin = 0;
  std::size_t end = 0;
};

std::vector<Chunk> chunks_of(const std::vector<PointRef>& points) {
  std::vector<Chunk> chunks;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const bool fits = !chunks.empty() && chunks.back().host == points[i].host && i - chunks.back().begin < kChunk;
    if (!fits) chunks.push_back({points[i].host, i, i});
    chunks.back().end = i + 1;
  }
  return chunks;
}

/// Sums of a chunk: by target, and what its points' elimination takes away (rows of lanes, n a row; right of the
/// diagonal block and in it).
struct ChunkSums {
  int host = 0;
  std::vector<PairSums> pairs;
  std::vector<LensSums> lens;  ///< by target; empty where the lens is not estimated
  std::vector<Row> H_schur;
  std::vector<Row> b_schur;
};

/// Windows are small: a point's coupling with all of it (eight numbers for each keyframe, and a last block for the
/// lens) stays on the stack.
constexpr int kMaxBlocks = 32;

class Builder {
 public:
  Builder(Window& window, const std::vector<Pair>& pairs, double rho_damping)
      : window_(window),
        pairs_(pairs),
        n_(window.size()),
        lens_(window.lens.estimated),
        blocks_(n_ + (lens_ ? 1 : 0)),
        damping_(static_cast<float>(1.0 + rho_damping)) {
    assert(blocks_ <= kMaxBlocks);
    for (const Pair& pair : pairs) rows_.push_back(host_rows(pair.relative_by_host));
  }

  ChunkSums sum(const std::vector<PointRef>& points, const Chunk& chunk) const {
    const std::size_t n = blocks_;
    ChunkSums sums{chunk.host, std::vector<PairSums>(n_), std::vector<LensSums>(lens_ ? n_ : 0),
                   std::vector<Row>(8 * n * n), std::vector<Row>(n)};
    add_points(points, chunk, sums);
    return sums;
  }

  NormalEquations assemble(const std::vector<ChunkSums>& chunks) const {
    const int size = window_.unknowns();
    NormalEquations system{MatrixXd::Zero(size, size), VectorXd::Zero(size)};
    std::vector<Mat8> H(pairs_.size(), Mat8::Zero());
    std::vector<Vec8> b(pairs_.size(), Vec8::Zero());
    for (const ChunkSums& chunk : chunks) {
      for (int target = 0; target < n_; ++target) {
        const PairSums& pair = chunk.pairs[target];
        const std::size_t p = static_cast<std::size_t>(chunk.host) * n_ + target;
        for (int i = 0; i < 8; ++i) {
          for (int j = i; j < 8; ++j) H[p](i, j) += pair.H[i][j];
          b[p][i] += pair.b[i];
        }
      }
      subtract_schur(chunk, system);
    }
    system.H.triangularView<Eigen::StrictlyLower>() = system.H.transpose();
    for (int host = 0; host < n_; ++host) {
      for (int target = 0; target < n_; ++target) {
        if (host != target) add_pair(H[host * n_ + target], b[host * n_ + target], host, target, system);
      }
    }
    if (lens_) add_lens_sums(chunks, system);
    return system;
  }

 private:
  void subtract_schur(const ChunkSums& chunk, NormalEquations& system) const {
    const int size = window_.unknowns();
    for (int row = 0; row < size; ++row) {
      for (int column = row; column < size; ++column) {
        system.H(row, column) -= chunk.H_schur[static_cast<std::size_t>(row) * blocks_ + column / 8].lanes[column % 8];
      }
      system.b[row] -= chunk.b_schur[row / 8].lanes[row % 8];
    }
  }

  TILEFLIGHT_WIDE_VECTORS
  void add_points(const std::vector<PointRef>& points, const Chunk& chunk, ChunkSums& sums) const {
    for (std::size_t i = chunk.begin; i < chunk.end; ++i) {
      ActivePoint& point = window_.keyframes[points[i].host].points[points[i].index];
      std::array<Lanes, kMaxBlocks> coupling;
      for (int k = 0; k < blocks_; ++k) coupling[k] = Lanes{};
      float H_rho_rho = 0, b_rho = 0;
      std::uint32_t touched = 0;
      for (const Observation& observation : point.observations) {
        if (observation.state != ResidualState::kGood) continue;
        const Linearization& lin = observation.linearization;
        const std::size_t p = static_cast<std::size_t>(chunk.host) * n_ + observation.target;
        const RelativeLanes relative(lin);
        add_residual(lin, relative, sums.pairs[observation.target]);
        Lanes by_rho;
        rho_coupling(lin, relative, by_rho);
        coupling[observation.target] += by_rho;
        for (int k = 0; k < 8; ++k) coupling[chunk.host] += by_rho[k] * rows_[p].rows[k];
        if (lens_) {
          const LensLanesOf lens(lin);
          add_lens(lin, relative, lens, sums.lens[observation.target]);
          Lanes lens_by_rho;
          rho_lens_coupling(lin, lens, lens_by_rho);
          coupling[n_] += lens_by_rho;
        }
        H_rho_rho += lin.pixel_by_rho.dot(lin.sums.gg * lin.pixel_by_rho);
        b_rho += lin.pixel_by_rho.dot(lin.sums.gr);
        touched |= (1U << observation.target) | (1U << chunk.host);
      }
      point.information = H_rho_rho;
      if (H_rho_rho < kMinInformation) continue;
      if (lens_) touched |= 1U << n_;
      eliminate(coupling, touched, 1.0F / (H_rho_rho * damping_), b_rho, sums);
    }
  }

  TILEFLIGHT_LANE_INLINE void eliminate(const std::array<Lanes, kMaxBlocks>& coupling, std::uint32_t touched,
                                        float inverse, float b_rho, ChunkSums& sums) const {
    for (int i = 0; i < blocks_; ++i) {
      if ((touched >> i & 1U) == 0) continue;
      const Lanes scaled = inverse * coupling[i];
      sums.b_schur[i].lanes += scaled * b_rho;
      for (int j = i; j < blocks_; ++j) {
        if ((touched >> j & 1U) == 0) continue;
        for (int k = 0; k < 8; ++k) {
          sums.H_schur[(8 * static_cast<std::size_t>(i) + k) * blocks_ + j].lanes += scaled[k] * coupling[j];
        }
      }
    }
  }

  void add_pair(const Mat8& upper, const Vec8& b, int host, int target, NormalEquations& system) const {
    const Mat8 H = upper.selfadjointView<Eigen::Upper>();
    const Mat8& M = pairs_[host * n_ + target].relative_by_host;
    const Mat8 HM = H * M;
    system.H.block<8, 8>(8 * target, 8 * target) += H;
    system.H.block<8, 8>(8 * target, 8 * host) += HM;
    system.H.block<8, 8>(8 * host, 8 * target) += HM.transpose();
    system.H.block<8, 8>(8 * host, 8 * host) += M.transpose() * HM;
    system.b.segment<8>(8 * target) += b;
    system.b.segment<8>(8 * host) += M.transpose() * b;
  }

  void add_lens_sums(const std::vector<ChunkSums>& chunks, NormalEquations& system) const {
    using Mat4 = Eigen::Matrix4d;
    const int at = 8 * n_;
    for (int host = 0; host < n_; ++host) {
      for (int target = 0; target < n_; ++target) {
        Eigen::Matrix<double, 8, kLensUnknowns> by_relative = Eigen::Matrix<double, 8, kLensUnknowns>::Zero();
        Mat4 H = Mat4::Zero();
        for (const ChunkSums& chunk : chunks) {
          if (chunk.host != host) continue;
          const LensSums& sums = chunk.lens[target];
          for (int j = 0; j < kLensUnknowns; ++j) {
            for (int i = 0; i < 8; ++i) by_relative(i, j) += sums.by_relative[i][j];
            for (int i = 0; i < kLensUnknowns; ++i) H(i, j) += sums.H[i][j];
            system.b[at + j] += sums.b[j];
          }
        }
        const Eigen::Matrix<double, 8, kLensUnknowns> by_host =
            pairs_[host * n_ + target].relative_by_host.transpose() * by_relative;
        system.H.block<8, kLensUnknowns>(8 * target, at) += by_relative;
        system.H.block<kLensUnknowns, 8>(at, 8 * target) += by_relative.transpose();
        system.H.block<8, kLensUnknowns>(8 * host, at) += by_host;
        system.H.block<kLensUnknowns, 8>(at, 8 * host) += by_host.transpose();
        system.H.bottomRightCorner<kLensUnknowns, kLensUnknowns>() += H;
      }
    }
  }

  Window& window_;
  const std::vector<Pair>& pairs_;
  std::vector<HostRows> rows_;
  int n_;
  bool lens_;
  int blocks_;  ///< of eight unknowns: one a keyframe, and the lens's
  float damping_;
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
  const std::vector<Chunk> chunks = chunks_of(points);
  std::vector<ChunkSums> sums(chunks.size());
  tbb::parallel_for(std::size_t{0}, chunks.size(), [&](std::size_t c) { sums[c] = builder.sum(points, chunks[c]); });
  return builder.assemble(sums);
}

void back_substitute(Window& window, const std::vector<Pair>& pairs, const std::vector<PointRef>& points,
                     const VectorXd& x, double rho_damping) {
  const int n = window.size();
  std::vector<Row> relative_step(pairs.size());
  for (int h = 0; h < n; ++h) {
    for (int t = 0; t < n; ++t) {
      if (h == t) continue;
      const Vec8 step = x.segment<8>(8 * t) + pairs[h * n + t].relative_by_host * x.segment<8>(8 * h);
      for (int i = 0; i < 8; ++i) relative_step[h * n + t].lanes[i] = static_cast<float>(step[i]);
    }
  }
  const auto damping = static_cast<float>(1.0 + rho_damping);
  Eigen::Vector4f lens_step = Eigen::Vector4f::Zero();
  if (window.lens.estimated) lens_step = x.tail<kLensUnknowns>().cast<float>();
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, points.size(), kChunk), [&](const auto& range) {
    for (std::size_t i = range.begin(); i < range.end(); ++i) {
      ActivePoint& point = window.keyframes[points[i].host].points[points[i].index];
      float H = 0, b = 0;
      for (const Observation& observation : point.observations) {
        if (observation.state != ResidualState::kGood) continue;
        const Linearization& lin = observation.linearization;
        Lanes coupling;
        rho_coupling(lin, RelativeLanes(lin), coupling);
        H += lin.pixel_by_rho.dot(lin.sums.gg * lin.pixel_by_rho);
        b += lin.pixel_by_rho.dot(lin.sums.gr) +
             lane_sum(coupling * relative_step[points[i].host * n + observation.target].lanes);
        if (window.lens.estimated) b += (lin.sums.gg * lin.pixel_by_rho).dot(lin.pixel_by_lens * lens_step);
      }
      point.step = H < kMinInformation ? 0.0F : -b / (H * damping);
    }
  });
}

VectorXd stacked_delta(const Window& window) {
  VectorXd delta(window.unknowns());
  for (int i = 0; i < window.size(); ++i) delta.segment<8>(8 * i) = window.keyframes[i].delta;
  if (window.lens.estimated) delta.tail<kLensUnknowns>() = window.lens.delta;
  return delta;
}

}  // namespace tileflight::odometry
