#include "tileflight/slam/keyframes/residual.h"

#include <algorithm>

#include "tileflight/core/base/simd.h"
#include "tileflight/slam/keyframes/lane_sums.h"
#include "tileflight/slam/keyframes/pattern_samples.h"

namespace tileflight::keyframes {
namespace {

/// Geometric derivatives at the linearisation point (first estimate; DSO, eq. 13); false if the point projects outside
/// the lens.
bool linearize_geometry(const Lens& lens, const Patch& patch, float rho, const HostTargetPrecalc& frame,
                        bool lens_is_estimated, Linearization& out) {
  const Eigen::Vector3f X = frame.R_linear * patch.ray_linear + rho * frame.t_linear;
  Eigen::Vector2f pixel;
  Eigen::Matrix<float, 2, 3> pixel_by_X;
  if (!lens.project<float>(X, pixel, pixel_by_X)) return false;
  pixel_derivatives<float>(pixel_by_X, X, frame.t_linear, rho, out.d_pixel_d_pose, out.d_pixel_d_rho);
  if (lens_is_estimated) {
    const Eigen::Matrix2f target_by_host = pixel_by_X * (frame.R_linear * patch.d_ray_d_pixel);
    out.d_pixel_d_intrinsics = intrinsics_jacobian<float>(lens, pixel, patch.pixel, target_by_host);
  }
  return true;
}

TILEFLIGHT_LANE_INLINE void sample_pattern(const PyramidLevel& target, const WarpedPatch& warped,
                                           PatternSamples8& out) {
  const Eigen::Matrix2f& A = warped.d_pixel_d_host_pixel;
  const base::Float8 u = warped.pixel.x() + A(0, 0) * kPatternX + A(0, 1) * kPatternY;
  const base::Float8 v = warped.pixel.y() + A(1, 0) * kPatternX + A(1, 1) * kPatternY;
  sample_eight(target, u, v, out);
}

/// Asks for the grey values that sample_pattern() will read.
void prefetch_pattern(const PyramidLevel& target, const WarpedPatch& warped) {
  constexpr std::ptrdiff_t kLine = 64 / sizeof(float);  // values of a cache line
  const Eigen::Matrix2f& A = warped.d_pixel_d_host_pixel;
  const float reach_x = kPatternRadius_px * std::max(std::abs(A(0, 0)), std::abs(A(0, 1)));
  const float reach_y = kPatternRadius_px * std::max(std::abs(A(1, 0)), std::abs(A(1, 1)));
  const int left = static_cast<int>(warped.pixel.x() - reach_x) - 1;
  const int right = static_cast<int>(warped.pixel.x() + reach_x) + 2;
  const int bottom = std::min(static_cast<int>(warped.pixel.y() + reach_y) + 2, target.height - 1);
  for (int y = static_cast<int>(warped.pixel.y() - reach_y) - 1; y <= bottom; ++y) {
    const float* row = target.row(y);
    for (std::ptrdiff_t x = left; x < right; x += kLine) __builtin_prefetch(row + x);
    __builtin_prefetch(row + right);
  }
}

}  // namespace

ResidualValue evaluate_residual(const Lens& lens, const PyramidLevel& target, const Patch& patch, float rho,
                                const HostTargetPrecalc& frame, float huber, Linearization* linearization,
                                const Lens* lens_linear) {
  ResidualWarp warp;
  warp.inside = warp_patch(lens, patch, frame.current.R, frame.current.t, rho, warp.warped) &&
                pattern_inside(target, warp.warped);
  return evaluate_residual(warp, lens, target, patch, rho, frame, huber, linearization, lens_linear);
}

void warp_residual(const Lens& lens, const PyramidLevel& target, const Patch& patch, float rho,
                   const HostTargetPrecalc& frame, ResidualWarp& out) {
  out.inside =
      warp_patch(lens, patch, frame.current.R, frame.current.t, rho, out.warped) && pattern_inside(target, out.warped);
  if (out.inside) prefetch_pattern(target, out.warped);
}

TILEFLIGHT_WIDE_VECTORS
ResidualValue evaluate_residual(const ResidualWarp& warp, const Lens& lens, const PyramidLevel& target,
                                const Patch& patch, float rho, const HostTargetPrecalc& frame, float huber,
                                Linearization* linearization, const Lens* lens_linear) {
  ResidualValue value;
  if (!warp.inside) return value;
  if (linearization != nullptr && !linearize_geometry(lens_linear != nullptr ? *lens_linear : lens, patch, rho, frame,
                                                      lens_linear != nullptr, *linearization)) {
    return value;
  }
  PatternSamples8 lanes;
  sample_pattern(target, warp.warped, lanes);
  base::Float8 host, weight, robust;
  base::load_float8(patch.intensity.data(), host);
  base::load_float8(patch.weight.data(), weight);
  const base::Float8 residual = lanes.grey - (frame.current.gain * host + frame.current.offset);
  base::huber_weights(residual, huber, robust);
  const base::Float8 w = weight * robust;
  const base::Float8 energy = w * residual * residual * (2.0F - robust);
  value.state = ResidualState::kGood;
  if (linearization == nullptr) {
    value.energy = base::horizontal_sum(energy);
    return value;
  }
  const base::Float8 A = -frame.gain_linear * (host - frame.host_b_linear);
  const base::Float8 wx = w * lanes.gx, wy = w * lanes.gy, wA = w * A;
  base::Float4 g, gA, AA, r;
  sum_lanes(energy, wx * lanes.gx, wx * lanes.gy, wy * lanes.gy, g);
  sum_lanes(wx * A, wx, wy * A, wy, gA);
  sum_lanes(wA * A, wA, w, wA * residual, AA);
  sum_lanes(wx * residual, wy * residual, w * residual, base::Float8{}, r);
  PatternSums& sums = linearization->sums;
  value.energy = g[0];
  sums.gg << g[1], g[2], g[2], g[3];
  sums.gA << gA[0], -gA[1], gA[2], -gA[3];
  sums.AA << AA[0], -AA[1], -AA[1], AA[2];
  sums.gr << r[0], r[1];
  sums.Ar << AA[3], -r[2];
  return value;
}

TILEFLIGHT_WIDE_VECTORS
RhoLinearization evaluate_rho(const Lens& lens, const PyramidLevel& target, const Patch& patch, float rho,
                              const PairTransform& pair, float huber) {
  RhoLinearization out;
  WarpedPatch warped;
  if (!warp_patch(lens, patch, pair.R, pair.t, rho, warped) || !pattern_inside(target, warped)) return out;
  const Eigen::Vector2f pixel_by_rho = warped.d_pixel_d_X * pair.t;
  PatternSamples8 lanes;
  sample_pattern(target, warped, lanes);
  base::Float8 host, weight, robust;
  base::load_float8(patch.intensity.data(), host);
  base::load_float8(patch.weight.data(), weight);
  const base::Float8 residual = lanes.grey - (pair.gain * host + pair.offset);
  base::huber_weights(residual, huber, robust);
  const base::Float8 w = weight * robust;
  const base::Float8 J = lanes.gx * pixel_by_rho.x() + lanes.gy * pixel_by_rho.y();
  base::Float4 sums;
  sum_lanes(w * residual * residual * (2.0F - robust), w * J * J, w * J * residual, base::Float8{}, sums);
  out.energy = sums[0];
  out.H = sums[1];
  out.b = sums[2];
  out.state = ResidualState::kGood;
  return out;
}

}  // namespace tileflight::keyframes
