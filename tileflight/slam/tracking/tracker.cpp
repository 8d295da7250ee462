#include "tileflight/slam/tracking/tracker.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/partitioner.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>

#include "tileflight/slam/keyframes/lens8.h"
#include "tileflight/slam/keyframes/patch.h"
#include "tileflight/slam/keyframes/rolling_shutter8.h"

namespace tileflight::tracking {

std::vector<geometry::SE3> motion_hypotheses(const geometry::SE3& T_last_reference,
                                             const geometry::SE3& T_last_before_last, int turns) {
  using geometry::SE3;
  // Chosen by hand.
  constexpr double kSmallestTurn_rad = 0.02;
  const SE3 constant = T_last_before_last * T_last_reference;
  const SE3 half = SE3::exp(0.5 * T_last_before_last.log());
  std::vector<SE3> poses{constant, T_last_before_last * constant, half * T_last_reference, T_last_reference, SE3()};
  for (int turn = 0; turn < turns; ++turn) {
    const double angle = kSmallestTurn_rad * (1 << turn);
    for (int x = -1; x <= 1; ++x) {
      for (int y = -1; y <= 1; ++y) {
        for (int z = -1; z <= 1; ++z) {
          if (x == 0 && y == 0 && z == 0) continue;
          poses.push_back(SE3(geometry::so3_exp(angle * geometry::Vec3(x, y, z)), geometry::Vec3::Zero()) * constant);
        }
      }
    }
  }
  return poses;
}

namespace {

using geometry::SE3;
using Vec8 = Eigen::Matrix<double, 8, 1>;
using Mat8 = Eigen::Matrix<double, 8, 8>;

constexpr std::size_t kChunk = 512;  ///< pixels per task; fixed, so that sums do not depend on the number of threads
constexpr int kUnknowns = 8;
constexpr int kRows = kUnknowns + 1;                               ///< unknowns and the residual
constexpr std::array<int, 6> kIterations{10, 20, 40, 40, 40, 40};  ///< by level; 10 and 20 as in DSO's implementation
                                                                   ///< (then 50), 40 chosen by hand

/// Sums over some pixels of a level.
struct Sums {
  Eigen::Matrix<double, kRows, kRows> normal = Eigen::Matrix<double, kRows, kRows>::Zero();  ///< (J, r)^T w (J, r): H
                                                                                             ///< and b of DSO, eq. 10
  double energy = 0.0;
  int inside = 0;
  int saturated = 0;

  void add(const Sums& o) {
    normal += o.normal;
    energy += o.energy;
    inside += o.inside;
    saturated += o.saturated;
  }
  double rmse() const { return inside > 0 ? std::sqrt(energy / inside) : std::numeric_limits<double>::infinity(); }
};

/// Rows of (J, r) of a chunk of pixels; excluded pixels have weight 0.
struct JacobianRows {
  alignas(32) std::array<std::array<float, kChunk>, kRows> values;
  alignas(32) std::array<float, kChunk> weight;
};

/// State shared by all pixels of a chunk.
struct ChunkState {
  std::array<std::array<float, 3>, 3> R;
  std::array<float, 3> t;
  float gain = 1.0F;
  float offset = 0.0F;
  float cutoff = 0.0F;
  float huber = 0.0F;
  bool by_row = false;
  keyframes::RowMotion rows;  ///< motion over the readout; used if `by_row`
};

struct LevelProblem {
  const keyframes::Lens& lens;
  const ReferenceLevel& reference;
  const keyframes::PyramidLevel& target;
  const keyframes::RollingShutter& shutter;
  int index = 0;
  int picture_height = 0;  ///< of level 0

  bool is_finest() const { return index == 0; }
};

/// Adds row I of the normal matrix of (J, r) over `blocks` blocks of SIMD lanes.
template <int I>
TILEFLIGHT_LANE_INLINE void accumulate_row(const JacobianRows& rows, std::size_t blocks, Sums& sums) {
  constexpr int kColumns = kRows - I;
  std::array<base::Float8, kColumns> sum{};
  for (std::size_t k = 0; k < blocks; ++k) {
    base::Float8 weighted, value, weight;
    base::load_float8(rows.weight.data() + k * base::kLanes, weight);
    base::load_float8(rows.values[I].data() + k * base::kLanes, value);
    weighted = weight * value;
    for (int j = 0; j < kColumns; ++j) {
      base::load_float8(rows.values[I + j].data() + k * base::kLanes, value);
      sum[j] += weighted * value;
    }
  }
  for (int j = 0; j < kColumns; ++j) {
    double total = 0;
    for (int lane = 0; lane < base::kLanes; ++lane) total += sum[j][lane];
    sums.normal(I, I + j) += total;
  }
}

/// Evaluates residuals and Jacobians of eight pixels, starting at `first`, into block `block` of `rows`. One function,
/// because its five steps share most of their values and all of it must be inlined into both variants of
/// evaluate_chunk().
template <bool kByRow>
TILEFLIGHT_LANE_INLINE void evaluate_block(const LevelProblem& level, const keyframes::Lens8& lens,
                                           const ChunkState& state, std::size_t first, std::size_t block,
                                           JacobianRows& rows, base::Float8& energy, base::Mask8& inside_count,
                                           base::Mask8& saturated_count) {
  constexpr float kMargin_px = 2.0F;
  const ReferenceLevel& reference = level.reference;

  // 1. Points in the target's frame: DSO, eq. 5, with a ray and an inverse distance instead of an inverse depth:
  //    X = R ray + rho t.
  std::array<base::Float8, 3> ray, X;
  base::Float8 rho, host;
  for (int d = 0; d < 3; ++d) base::load_float8(reference.ray[d].data() + first, ray[d]);
  base::load_float8(reference.rho.data() + first, rho);
  base::load_float8(reference.intensity.data() + first, host);
  for (int d = 0; d < 3; ++d) {
    X[d] = state.R[d][0] * ray[0] + state.R[d][1] * ray[1] + state.R[d][2] * ray[2] + rho * state.t[d];
  }

  // 2. Their pixels p' (eq. 5 with the lens as Pi_c), and which of them lie inside the target.
  keyframes::Pixels8 pixel;
  std::array<base::Float8, 3> X_row;
  base::Float8 share;
  if constexpr (kByRow) {
    keyframes::project_rolling_shutter(lens, state.rows, X, rho, X_row, pixel, share);
  } else {
    lens.project(X, pixel);
  }
  const keyframes::PyramidLevel& target = level.target;
  const base::Mask8 inside = pixel.valid & (pixel.u >= kMargin_px) & (pixel.v >= kMargin_px) &
                             (pixel.u < static_cast<float>(target.width - 1) - kMargin_px) &
                             (pixel.v < static_cast<float>(target.height - 1) - kMargin_px);

  // 3. The target's intensity and its gradient there (grad I of eq. 13), lane by lane; lanes of the padding do not
  //    count.
  const std::size_t left = reference.size() - first;
  base::Float8 grey{}, gx{}, gy{};
  base::Mask8 counts{};
  for (std::size_t i = 0; i < std::min<std::size_t>(base::kLanes, left); ++i) {
    if (!inside[i]) continue;
    const keyframes::Texel texel = target.sample(pixel.u[i], pixel.v[i]);
    grey[i] = texel[static_cast<int>(keyframes::kIntensity)];
    gx[i] = texel[static_cast<int>(keyframes::kGradX)];
    gy[i] = texel[static_cast<int>(keyframes::kGradY)];
    counts[i] = -1;
  }

  // 4. Residuals and robust weights: eq. 4 for one pixel and relative brightness, r = I_target - e^a I_reference - b,
  //    under its Huber norm. A saturated pixel counts with the energy at the cut-off and has no gradient.
  const base::Float8 zero{}, predicted = state.gain * host, r = grey - predicted - state.offset;
  base::Float8 size, robust;
  base::absolute(r, size);
  base::huber_weights(r, state.huber, robust);
  const base::Mask8 saturated = counts & (size > state.cutoff), good = counts & ~saturated;
  const float saturated_energy = state.huber * (2.0F * state.cutoff - state.huber);
  energy += good ? robust * r * r * (2.0F - robust) : (saturated ? zero + saturated_energy : zero);
  inside_count -= counts;
  saturated_count -= saturated;

  // 5. Rows of (J, r), eq. 13: grad I times d(pixel)/d(X), then by a left increment of T_target_reference (eq. 1),
  //    d(X)/d(translation) = rho, d(X)/d(rotation) = -[X]x, and by a and b.
  std::array<base::Float8, 3> by_X;
  if constexpr (kByRow) {
    keyframes::intensity_jacobian(state.rows, X_row, rho, pixel, share, gx, gy, by_X);
  } else {
    for (int d = 0; d < 3; ++d) by_X[d] = pixel.d_u_d_X[d] * gx + pixel.d_v_d_X[d] * gy;
  }
  const auto put = [&](int row, const base::Float8& value) __attribute__((always_inline)) {
    base::store_float8(good ? value : zero, rows.values[row].data() + block * base::kLanes);
  };
  for (int d = 0; d < 3; ++d) put(d, rho * by_X[d]);
  put(3, X[1] * by_X[2] - X[2] * by_X[1]);
  put(4, X[2] * by_X[0] - X[0] * by_X[2]);
  put(5, X[0] * by_X[1] - X[1] * by_X[0]);
  put(6, -predicted);
  put(7, zero - 1.0F);
  put(8, r);
  base::store_float8(good ? robust : zero, rows.weight.data() + block * base::kLanes);
}

TILEFLIGHT_WIDE_VECTORS
void evaluate_chunk(const LevelProblem& level, const ChunkState& state, std::size_t begin, std::size_t end,
                    Sums& sums) {
  JacobianRows rows;
  const keyframes::Lens8 lens(level.lens);
  const std::size_t blocks = (end - begin + base::kLanes - 1) / base::kLanes;
  base::Float8 energy{};
  base::Mask8 inside{}, saturated{};
  if (state.by_row) {
    for (std::size_t k = 0; k < blocks; ++k)
      evaluate_block<true>(level, lens, state, begin + k * base::kLanes, k, rows, energy, inside, saturated);
  } else {
    for (std::size_t k = 0; k < blocks; ++k)
      evaluate_block<false>(level, lens, state, begin + k * base::kLanes, k, rows, energy, inside, saturated);
  }
  sums.energy = base::horizontal_sum(energy);
  for (int i = 0; i < base::kLanes; ++i) {
    sums.inside += inside[i];
    sums.saturated += saturated[i];
  }
  accumulate_row<0>(rows, blocks, sums);
  accumulate_row<1>(rows, blocks, sums);
  accumulate_row<2>(rows, blocks, sums);
  accumulate_row<3>(rows, blocks, sums);
  accumulate_row<4>(rows, blocks, sums);
  accumulate_row<5>(rows, blocks, sums);
  accumulate_row<6>(rows, blocks, sums);
  accumulate_row<7>(rows, blocks, sums);
  accumulate_row<8>(rows, blocks, sums);
}

keyframes::RowMotion row_motion(const LevelProblem& level, const SE3& T_target_reference) {
  keyframes::RowMotion rows;
  // Level 0's row is (v + 0.5) 2^l - 0.5.
  const double scale = 1 << level.index, height = level.picture_height;
  rows.share_per_row = static_cast<float>(scale / height);
  rows.share_at_zero = static_cast<float>((0.5 * scale - 0.5 * height) / height);
  const geometry::Vec6 twist = level.shutter.twist(T_target_reference);
  for (int d = 0; d < 3; ++d) {
    rows.v[d] = static_cast<float>(twist[d]);
    rows.w[d] = static_cast<float>(twist[3 + d]);
  }
  rows.d_twist_d_pose = static_cast<float>(level.shutter.motion_share);
  return rows;
}

ChunkState chunk_state(const LevelProblem& level, const ImageAlignmentState& state, float cutoff, float huber) {
  ChunkState out;
  const geometry::Mat3 R = state.T_target_reference.rotation.toRotationMatrix();
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) out.R[i][j] = static_cast<float>(R(i, j));
    out.t[i] = static_cast<float>(state.T_target_reference.translation[i]);
  }
  out.gain = static_cast<float>(std::exp(state.a));
  out.offset = static_cast<float>(state.b);
  out.cutoff = cutoff;
  out.huber = huber;
  out.by_row = !level.shutter.is_global();
  if (out.by_row) out.rows = row_motion(level, state.T_target_reference);
  return out;
}

Sums evaluate(const LevelProblem& level, const ImageAlignmentState& state, float cutoff, float huber) {
  // Below some thousand pixels a task costs more than it saves. Chosen by hand.
  constexpr std::size_t kChunksPerTask = 6;
  const std::size_t n = level.reference.size();
  const std::size_t chunks = (n + kChunk - 1) / kChunk;
  const ChunkState common = chunk_state(level, state, cutoff, huber);
  std::vector<Sums> parts(chunks);
  const auto run = [&](std::size_t begin, std::size_t end) {
    for (std::size_t c = begin; c < end; ++c) {
      evaluate_chunk(level, common, c * kChunk, std::min(n, (c + 1) * kChunk), parts[c]);
    }
  };
  if (chunks <= kChunksPerTask) {
    run(0, chunks);
  } else {
    tbb::parallel_for(
        tbb::blocked_range<std::size_t>(0, chunks, kChunksPerTask),
        [&](const tbb::blocked_range<std::size_t>& range) { run(range.begin(), range.end()); },
        tbb::simple_partitioner());
  }
  Sums total;
  for (const Sums& part : parts) total.add(part);
  return total;
}

ImageAlignmentState apply_delta(const ImageAlignmentState& state, const Vec8& step) {
  ImageAlignmentState out = state;
  // DSO, eq. 1: left-multiplied increment.
  out.T_target_reference = SE3::exp(step.head<6>()) * state.T_target_reference;
  out.a += step[6];
  out.b += step[7];
  return out;
}

Mat8 normal_matrix(const Sums& sums) {
  return sums.normal.topLeftCorner<kUnknowns, kUnknowns>().selfadjointView<Eigen::Upper>();
}

/// Levenberg-Marquardt step: solves (H + lambda diag H) x = -b with the unknowns scaled to a unit diagonal.
Vec8 damped_step(const Sums& sums, double lambda) {
  const Mat8 H = normal_matrix(sums);
  const Vec8 b = sums.normal.col(kUnknowns).head<kUnknowns>();
  const Vec8 scale = (H.diagonal().array() + 1e-9).sqrt().inverse();
  Mat8 A = scale.asDiagonal() * H * scale.asDiagonal();
  A.diagonal().array() += lambda + 1e-9;
  return -(scale.asDiagonal() * A.ldlt().solve(scale.asDiagonal() * b));
}

struct LevelResult {
  ImageAlignmentState state;
  Sums sums;
};

LevelResult align_level(const LevelProblem& level, const ImageAlignmentState& start, int iterations,
                        const keyframes::TrackingOptions& options) {
  constexpr double kSaturatedShare = 0.6;  // above it the initial pose is far off: double the cut-off, as in DSO's
                                           // implementation
  // Steps are compared with the estimate's own uncertainty: step^T H step over the residual variance is 8 on average
  // for an error of one standard deviation in every unknown. Coarser levels need less, since they are refined. Both
  // limits are chosen by hand.
  const double converged = level.is_finest() ? 0.1 : 1.0;
  const double hopeless = level.is_finest() ? 1.0 : 8.0;  // for a step that did not lower the energy
  // Chosen by hand.
  constexpr double kLargestLambda = 1e3;
  float cutoff = options.cutoff;
  LevelResult best{start, evaluate(level, start, cutoff, options.huber)};
  while (best.sums.saturated > kSaturatedShare * best.sums.inside && cutoff < 20.0F * options.cutoff) {
    cutoff *= 2.0F;
    best.sums = evaluate(level, start, cutoff, options.huber);
  }
  // Damping schedule, chosen by hand: x 0.3 after a better step, x 6 after a worse one.
  double lambda = 0.01;
  for (int i = 0; i < iterations && best.sums.inside > 0; ++i) {
    const Vec8 step = damped_step(best.sums, lambda);
    if (!step.allFinite()) break;
    const ImageAlignmentState candidate = apply_delta(best.state, step);
    const Sums sums = evaluate(level, candidate, cutoff, options.huber);
    const bool better =
        sums.inside > 0.5 * best.sums.inside && sums.energy / sums.inside < best.sums.energy / best.sums.inside;
    if (better) best = {candidate, sums};
    const double significance = step.dot(normal_matrix(best.sums) * step) * best.sums.inside / best.sums.energy;
    if (significance < (better ? converged : hopeless)) break;
    lambda = better ? lambda * 0.3 : std::max(lambda, 1e-4) * 6.0;
    if (lambda > kLargestLambda) break;
  }
  return best;
}

}  // namespace

ImageAlignment align_image(const keyframes::LensPyramid& lens, const TrackingReference& reference,
                           const keyframes::Pyramid& target, const ImageAlignmentState& start,
                           const keyframes::TrackingOptions& options, const std::vector<double>& give_up_rmse,
                           int finest_level, const keyframes::RollingShutter& shutter) {
  ImageAlignment result;
  result.state = start;
  const int levels = static_cast<int>(reference.levels.size());
  result.rmse.assign(levels, std::numeric_limits<double>::infinity());
  for (int l = levels - 1; l >= finest_level; --l) {
    const LevelProblem level{lens.lenses[l],         reference.levels[l], target.levels[l], shutter, l,
                             target.levels[0].height};
    const LevelResult outcome = align_level(level, result.state, kIterations[std::min(l, 5)], options);
    result.state = outcome.state;
    result.rmse[l] = outcome.sums.rmse();
    if (!give_up_rmse.empty() && result.rmse[l] > give_up_rmse[l]) return result;
    if (l > finest_level) continue;
    result.inside_share = static_cast<double>(outcome.sums.inside) / std::max<std::size_t>(1, level.reference.size());
    result.saturated_share = static_cast<double>(outcome.sums.saturated) / std::max(1, outcome.sums.inside);
    result.information = normal_matrix(outcome.sums);
  }
  // A limit on the gain, because an image without contrast (black) fits everything with a gain near zero.
  result.converged = result.finest_rmse() < options.lost_rmse && result.inside_share > options.min_inside_share &&
                     std::abs(result.state.a) < options.max_log_gain;
  return result;
}

Eigen::Matrix<double, 6, 6> pose_covariance(const ImageAlignment& alignment) {
  const Mat8 H = alignment.information;
  const Vec8 scale = (H.diagonal().array() + 1e-9).sqrt().inverse();
  Mat8 A = scale.asDiagonal() * H * scale.asDiagonal();
  A.diagonal().array() += 1e-9;
  const Mat8 covariance = scale.asDiagonal() * A.ldlt().solve(Mat8::Identity()) * scale.asDiagonal();
  const double rmse = alignment.finest_rmse();
  return rmse * rmse * covariance.topLeftCorner<6, 6>();
}

OpticalFlow optical_flow(const keyframes::LensPyramid& lens, const TrackingReference& reference, const SE3& T) {
  constexpr std::size_t kStride = 7;
  const ReferenceLevel& level = reference.levels[0];
  const Eigen::Matrix3f R = T.rotation.toRotationMatrix().cast<float>();
  const Eigen::Vector3f t = T.translation.cast<float>();
  double translation = 0, full = 0;
  int count = 0;
  for (std::size_t i = 0; i < level.size(); i += kStride) {
    Eigen::Vector2f shifted, moved_pixel;
    const Eigen::Vector3f shift = level.rho[i] * t;
    if (!lens.lenses[0].project<float>(level.ray_of(i) + shift, shifted)) continue;
    if (!lens.lenses[0].project<float>(R * level.ray_of(i) + shift, moved_pixel)) continue;
    // DSO, section 3.1, step 2: flow f with all motion, f_t with translation alone, each a root mean square.
    translation += (shifted - level.pixels[i]).squaredNorm();
    full += (moved_pixel - level.pixels[i]).squaredNorm();
    ++count;
  }
  if (count == 0) return {};
  return {std::sqrt(translation / count), std::sqrt(full / count)};
}

}  // namespace tileflight::tracking
