#include "tileflight/slam/mapping/normal_equations.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cassert>
#include <cstdint>

#include "tileflight/slam/mapping/residual_sums.h"

namespace tileflight::mapping {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr std::size_t kChunk = 16;         ///< points per task; few enough to be summed in float
constexpr float kMinInformation = 1e-10F;  ///< of rho; below it a point carries no information. Chosen by hand

/// The rows of a pair's d_relative_d_host.
struct alignas(sizeof(base::Float8)) HostRows {
  std::array<base::Float8, 8> rows{};
};

HostRows host_rows(const Mat8& relative_by_host) {
  HostRows out;
  for (int i = 0; i < 8; ++i) {
    for (int j = 0; j < 8; ++j) out.rows[i][j] = static_cast<float>(relative_by_host(i, j));
  }
  return out;
}

/// Consecutive points of one host.
struct Chunk {
  int host = 0;
  std::size_t begin = 0;
  std::size_t end = 0;
};

std::vector<Chunk> make_chunks(const std::vector<PointRef>& points) {
  std::vector<Chunk> chunks;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const bool fits = !chunks.empty() && chunks.back().host == points[i].host && i - chunks.back().begin < kChunk;
    if (!fits) chunks.push_back({points[i].host, i, i});
    chunks.back().end = i + 1;
  }
  return chunks;
}

/// Sums of a chunk: by target, and the Schur terms of its points (rows of lanes, n per row; diagonal and upper blocks
/// only).
struct ChunkSums {
  int host = 0;
  std::vector<PairSums> pairs;
  std::vector<LensSums> lens;  ///< by target; empty where the lens is not estimated
  PairSums stereo;             ///< by the brightness of the host's stereo pictures
  std::vector<AlignedFloat8> H_schur;
  std::vector<AlignedFloat8> b_schur;
};

/// Windows are small, so a point's coupling with all unknowns (eight numbers per keyframe, and a last block for the
/// intrinsics or for the stereo pictures of its host) is kept on the stack.
constexpr int kMaxBlocks = 32;

class NormalEquationsBuilder {
 public:
  NormalEquationsBuilder(keyframes::Window& window, const std::vector<HostTargetPair>& pairs, double rho_damping)
      : window_(window),
        pairs_(pairs),
        n_(window.size()),
        lens_(window.intrinsics.estimated),
        stereo_(window.has_stereo()),
        blocks_(n_ + (lens_ || stereo_ ? 1 : 0)),
        damping_(static_cast<float>(1.0 + rho_damping)) {
    assert(blocks_ <= kMaxBlocks && !(lens_ && stereo_));
    for (const HostTargetPair& pair : pairs) rows_.push_back(host_rows(pair.d_relative_d_host));
  }

  ChunkSums sum_chunk(const std::vector<PointRef>& points, const Chunk& chunk) const {
    const std::size_t n = blocks_;
    ChunkSums sums{chunk.host,
                   std::vector<PairSums>(n_),
                   std::vector<LensSums>(lens_ ? n_ : 0),
                   PairSums{},
                   std::vector<AlignedFloat8>(8 * n * n),
                   std::vector<AlignedFloat8>(n)};
    add_points(points, chunk, sums);
    return sums;
  }

  NormalEquations assemble(const std::vector<ChunkSums>& chunks) const {
    const int size = window_.unknowns();
    NormalEquations system{MatrixXd::Zero(size, size), VectorXd::Zero(size)};
    Totals totals(pairs_.size(), (size + 7) / 8);
    for (const ChunkSums& chunk : chunks) {
      for (int target = 0; target < n_; ++target) {
        PairTotals& pair = totals.pairs[static_cast<std::size_t>(chunk.host) * n_ + target];
        for (int i = 0; i < 8; ++i) add(chunk.pairs[target].H[i], pair.H[i]);
        add(chunk.pairs[target].b, pair.b);
      }
      if (stereo_) add_stereo_sums(chunk, totals);
      subtract_schur(chunk, totals);
    }
    for (int row = 0; row < size; ++row) {
      for (int column = row; column < size; ++column) system.H(row, column) = totals.H_of(row, column / 8)[column % 8];
      system.b[row] = totals.b[row / 8][row % 8];
    }
    system.H.triangularView<Eigen::StrictlyLower>() = system.H.transpose();
    for (int host = 0; host < n_; ++host) {
      for (int target = 0; target < n_; ++target) {
        if (host != target) add_pair(totals.pairs[host * n_ + target], host, target, system);
      }
    }
    if (lens_) add_lens_sums(chunks, system);
    return system;
  }

 private:
  using Double8 = std::array<double, 8>;
  struct PairTotals {
    std::array<Double8, 8> H{};
    Double8 b{};
  };
  /// Sums over all chunks, in the blocks of the window's unknowns; of H the diagonal and upper blocks.
  struct Totals {
    int blocks;
    std::vector<PairTotals> pairs;
    std::vector<Double8> H;
    std::vector<Double8> b;

    Totals(std::size_t pair_count, int block_count)
        : blocks(block_count),
          pairs(pair_count),
          H(8 * static_cast<std::size_t>(block_count) * static_cast<std::size_t>(block_count)),
          b(static_cast<std::size_t>(block_count)) {}
    Double8& H_of(int row, int block) { return H[static_cast<std::size_t>(row) * blocks + block]; }
  };

  static void add(const base::Float8& part, Double8& sum) {
    for (int k = 0; k < 8; ++k) sum[k] += static_cast<double>(part[k]);
  }
  static void subtract(const base::Float8& part, Double8& sum) {
    for (int k = 0; k < 8; ++k) sum[k] -= static_cast<double>(part[k]);
  }

  /// DSO, eq. 17 and 18: H_aa - H_ab H_bb^-1 H_ba, b_a - H_ab H_bb^-1 b_b.
  void subtract_schur(const ChunkSums& chunk, Totals& totals) const {
    // From a chunk's blocks to the window's, where each host has a block for its stereo pictures.
    const auto block = [&](int i) { return stereo_ && i == n_ ? n_ + chunk.host : i; };
    for (int i = 0; i < blocks_; ++i) {
      for (int row = 0; row < 8; ++row) {
        const AlignedFloat8* parts = chunk.H_schur.data() + (8 * static_cast<std::size_t>(i) + row) * blocks_;
        for (int j = i; j < blocks_; ++j) subtract(parts[j].value, totals.H_of(8 * block(i) + row, block(j)));
      }
      subtract(chunk.b_schur[i].value, totals.b[block(i)]);
    }
  }

  void add_stereo_sums(const ChunkSums& chunk, Totals& totals) const {
    const int block = n_ + chunk.host;
    for (int i = 0; i < 8; ++i) add(chunk.stereo.H[i], totals.H_of(8 * block + i, block));
    add(chunk.stereo.b, totals.b[block]);
  }

  TILEFLIGHT_WIDE_VECTORS
  void add_points(const std::vector<PointRef>& points, const Chunk& chunk, ChunkSums& sums) const {
    for (std::size_t i = chunk.begin; i < chunk.end; ++i) {
      keyframes::ActivePoint& point = window_.keyframes[points[i].host].points[points[i].index];
      std::array<base::Float8, kMaxBlocks> coupling;
      for (int k = 0; k < blocks_; ++k) coupling[k] = base::Float8{};
      float H_rho_rho = 0, b_rho = 0;
      std::uint32_t touched = 0;
      for (const keyframes::Observation& observation : point.observations) {
        if (observation.state != keyframes::ResidualState::kGood) continue;
        const keyframes::Linearization& lin = observation.linearization;
        const std::size_t p = static_cast<std::size_t>(chunk.host) * n_ + observation.target;
        const RelativeJacobian8 relative(lin);
        add_residual(lin, relative, sums.pairs[observation.target]);
        base::Float8 by_rho;
        rho_coupling(lin, relative, by_rho);
        coupling[observation.target] += by_rho;
        for (int k = 0; k < 8; ++k) coupling[chunk.host] += by_rho[k] * rows_[p].rows[k];
        if (lens_) {
          const LensJacobian8 lens(lin);
          add_lens(lin, relative, lens, sums.lens[observation.target]);
          base::Float8 lens_by_rho;
          rho_lens_coupling(lin, lens, lens_by_rho);
          coupling[n_] += lens_by_rho;
        }
        // H_bb and b_b of DSO, eq. 16, for the inverse distance: H_bb is diagonal, one number per point.
        H_rho_rho += lin.d_pixel_d_rho.dot(lin.sums.gg * lin.d_pixel_d_rho);
        b_rho += lin.d_pixel_d_rho.dot(lin.sums.gr);
        touched |= (1U << observation.target) | (1U << chunk.host);
      }
      for (const keyframes::Observation& observation : point.stereo_observations) {
        if (observation.state != keyframes::ResidualState::kGood) continue;
        const keyframes::Linearization& lin = observation.linearization;
        add_stereo(lin, observation.target, sums.stereo, coupling[n_]);
        H_rho_rho += lin.d_pixel_d_rho.dot(lin.sums.gg * lin.d_pixel_d_rho);
        b_rho += lin.d_pixel_d_rho.dot(lin.sums.gr);
        touched |= 1U << n_;
      }
      point.information = H_rho_rho;
      if (H_rho_rho < kMinInformation) continue;
      if (lens_) touched |= 1U << n_;
      eliminate(coupling, touched, 1.0F / (H_rho_rho * damping_), b_rho, sums);
    }
  }

  TILEFLIGHT_LANE_INLINE void eliminate(const std::array<base::Float8, kMaxBlocks>& coupling, std::uint32_t touched,
                                        float inverse, float b_rho, ChunkSums& sums) const {
    for (int i = 0; i < blocks_; ++i) {
      if ((touched >> i & 1U) == 0) continue;
      // DSO, eq. 17 and 18: H_ab H_bb^-1 H_ba and H_ab H_bb^-1 b_b.
      const base::Float8 scaled = inverse * coupling[i];
      sums.b_schur[i].value += scaled * b_rho;
      for (int j = i; j < blocks_; ++j) {
        if ((touched >> j & 1U) == 0) continue;
        for (int k = 0; k < 8; ++k) {
          sums.H_schur[(8 * static_cast<std::size_t>(i) + k) * blocks_ + j].value += scaled[k] * coupling[j];
        }
      }
    }
  }

  void add_pair(const PairTotals& sums, int host, int target, NormalEquations& system) const {
    Mat8 upper;
    for (int i = 0; i < 8; ++i) upper.row(i) = Eigen::Map<const Eigen::Matrix<double, 1, 8>>(sums.H[i].data());
    const Mat8 H = upper.selfadjointView<Eigen::Upper>();
    const Eigen::Map<const keyframes::Vec8> b(sums.b.data());
    const Mat8& M = pairs_[host * n_ + target].d_relative_d_host;
    // DSO, eq. 12 by the chain rule: J_target = J_relative, J_host = J_relative M.
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
            pairs_[host * n_ + target].d_relative_d_host.transpose() * by_relative;
        system.H.block<8, kLensUnknowns>(8 * target, at) += by_relative;
        system.H.block<kLensUnknowns, 8>(at, 8 * target) += by_relative.transpose();
        system.H.block<8, kLensUnknowns>(8 * host, at) += by_host;
        system.H.block<kLensUnknowns, 8>(at, 8 * host) += by_host.transpose();
        system.H.bottomRightCorner<kLensUnknowns, kLensUnknowns>() += H;
      }
    }
  }

  keyframes::Window& window_;
  const std::vector<HostTargetPair>& pairs_;
  std::vector<HostRows> rows_;
  int n_;
  bool lens_;
  bool stereo_;
  int blocks_;  ///< blocks of eight unknowns: one per keyframe, and one for the intrinsics or a host's stereo pictures
  float damping_;
};

}  // namespace

std::vector<PointRef> all_points(const keyframes::Window& window) {
  std::vector<PointRef> refs;
  for (int host = 0; host < window.size(); ++host) {
    for (int i = 0; i < static_cast<int>(window.keyframes[host].points.size()); ++i) refs.push_back({host, i});
  }
  return refs;
}

NormalEquations build_normal_equations(keyframes::Window& window, const std::vector<HostTargetPair>& pairs,
                                       const std::vector<PointRef>& points, double rho_damping) {
  const NormalEquationsBuilder builder(window, pairs, rho_damping);
  const std::vector<Chunk> chunks = make_chunks(points);
  std::vector<ChunkSums> sums(chunks.size());
  tbb::parallel_for(std::size_t{0}, chunks.size(),
                    [&](std::size_t c) { sums[c] = builder.sum_chunk(points, chunks[c]); });
  return builder.assemble(sums);
}

void back_substitute(keyframes::Window& window, const std::vector<HostTargetPair>& pairs,
                     const std::vector<PointRef>& points, const VectorXd& x, double rho_damping) {
  const int n = window.size();
  std::vector<AlignedFloat8> relative_step(pairs.size());
  for (int h = 0; h < n; ++h) {
    for (int t = 0; t < n; ++t) {
      if (h == t) continue;
      // Step of the pair's relative unknowns: x_target + M x_host.
      const keyframes::Vec8 step = x.segment<8>(8 * t) + pairs[h * n + t].d_relative_d_host * x.segment<8>(8 * h);
      for (int i = 0; i < 8; ++i) relative_step[h * n + t].value[i] = static_cast<float>(step[i]);
    }
  }
  const auto damping = static_cast<float>(1.0 + rho_damping);
  Eigen::Vector4f lens_step = Eigen::Vector4f::Zero();
  if (window.intrinsics.estimated) lens_step = x.tail<kLensUnknowns>().cast<float>();
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, points.size(), kChunk), [&](const auto& range) {
    for (std::size_t i = range.begin(); i < range.end(); ++i) {
      keyframes::ActivePoint& point = window.keyframes[points[i].host].points[points[i].index];
      float H = 0, b = 0;
      for (const keyframes::Observation& observation : point.observations) {
        if (observation.state != keyframes::ResidualState::kGood) continue;
        const keyframes::Linearization& lin = observation.linearization;
        base::Float8 coupling;
        rho_coupling(lin, RelativeJacobian8(lin), coupling);
        H += lin.d_pixel_d_rho.dot(lin.sums.gg * lin.d_pixel_d_rho);
        b += lin.d_pixel_d_rho.dot(lin.sums.gr) +
             base::horizontal_sum(coupling * relative_step[points[i].host * n + observation.target].value);
        if (window.intrinsics.estimated)
          b += (lin.sums.gg * lin.d_pixel_d_rho).dot(lin.d_pixel_d_intrinsics * lens_step);
      }
      for (const keyframes::Observation& observation : point.stereo_observations) {
        if (observation.state != keyframes::ResidualState::kGood) continue;
        const keyframes::Linearization& lin = observation.linearization;
        const Eigen::Vector2f light =
            x.segment<2>(window.stereo_unknown(points[i].host) + 2 * observation.target).cast<float>();
        H += lin.d_pixel_d_rho.dot(lin.sums.gg * lin.d_pixel_d_rho);
        b += lin.d_pixel_d_rho.dot(lin.sums.gr + lin.sums.gA * light);
      }
      // Second row of DSO, eq. 16: x_b = -H_bb^-1 (b_b + H_ba x_a), since b is of opposite sign here.
      point.step = H < kMinInformation ? 0.0F : -b / (H * damping);
    }
  });
}

VectorXd stacked_delta(const keyframes::Window& window) {
  VectorXd delta(window.unknowns());
  for (int i = 0; i < window.size(); ++i) delta.segment<8>(8 * i) = window.keyframes[i].delta;
  if (window.intrinsics.estimated) delta.tail<kLensUnknowns>() = window.intrinsics.delta;
  if (!window.has_stereo()) return delta;
  for (int i = 0; i < window.size(); ++i) delta.segment<8>(window.stereo_unknown(i)) = window.keyframes[i].stereo_delta;
  return delta;
}

}  // namespace tileflight::mapping
