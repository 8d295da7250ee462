#include "tileflight/odometry/residual.h"

#include "tileflight/odometry/lanes.h"

namespace tileflight::odometry {
namespace {

/// Geometric derivatives at the first estimate; false when it projects outside the lens.
bool linearize_geometry(const Lens& lens, const Patch& patch, float rho, const ResidualFrame& frame,
                        bool lens_is_estimated, Linearization& out) {
  const Eigen::Vector3f X = frame.R_linear * patch.ray_linear + rho * frame.t_linear;
  Eigen::Vector2f pixel;
  Eigen::Matrix<float, 2, 3> pixel_by_X;
  if (!lens.project<float>(X, pixel, pixel_by_X)) return false;
  pixel_derivatives<float>(pixel_by_X, X, frame.t_linear, rho, out.pixel_by_pose, out.pixel_by_rho);
  if (lens_is_estimated) {
    const Eigen::Matrix2f target_by_host = pixel_by_X * (frame.R_linear * patch.ray_by_pixel);
    out.pixel_by_lens = pixel_by_lens<float>(lens, pixel, patch.pixel, target_by_host);
  }
  return true;
}

/// The target under the pattern's eight pixels.
struct PatternLanes {
  Lanes grey, gx, gy;
};

TILEFLIGHT_LANE_INLINE void sample_pattern(const PyramidLevel& target, const WarpedPatch& warped, PatternLanes& out) {
  const Eigen::Matrix2f& A = warped.pixel_by_host_pixel;
  const Lanes u = warped.pixel.x() + A(0, 0) * kPatternX + A(0, 1) * kPatternY;
  const Lanes v = warped.pixel.y() + A(1, 0) * kPatternX + A(1, 1) * kPatternY;
  for (int k = 0; k < kPatternSize; ++k) {
    const Texel texel = target.sample(u[k], v[k]);
    out.grey[k] = texel[kIntensity];
    out.gx[k] = texel[kGradX];
    out.gy[k] = texel[kGradY];
  }
}

}  // namespace

TILEFLIGHT_WIDE_VECTORS
ResidualValue evaluate_residual(const Lens& lens, const PyramidLevel& target, const Patch& patch, float rho,
                                const ResidualFrame& frame, float huber, Linearization* linearization,
                                const Lens* lens_linear) {
  ResidualValue value;
  WarpedPatch warped;
  if (!warp_patch(lens, patch, frame.current.R, frame.current.t, rho, warped) || !pattern_inside(target, warped)) {
    return value;
  }
  if (linearization != nullptr && !linearize_geometry(lens_linear != nullptr ? *lens_linear : lens, patch, rho, frame,
                                                      lens_linear != nullptr, *linearization)) {
    return value;
  }
  PatternLanes lanes;
  sample_pattern(target, warped, lanes);
  Lanes host, weight, robust;
  load_lanes(patch.intensity.data(), host);
  load_lanes(patch.weight.data(), weight);
  const Lanes residual = lanes.grey - (frame.current.gain * host + frame.current.offset);
  huber_weights(residual, huber, robust);
  const Lanes w = weight * robust;
  value.energy = lane_sum(w * residual * residual * (2.0F - robust));
  value.state = ResidualState::kGood;
  if (linearization == nullptr) return value;
  const Lanes A = -frame.gain_linear * (host - frame.host_b_linear);
  const Lanes wx = w * lanes.gx, wy = w * lanes.gy, wA = w * A;
  PatternSums& sums = linearization->sums;
  const float xy = lane_sum(wx * lanes.gy), A_one = -lane_sum(wA);
  sums.gg << lane_sum(wx * lanes.gx), xy, xy, lane_sum(wy * lanes.gy);
  sums.gA << lane_sum(wx * A), -lane_sum(wx), lane_sum(wy * A), -lane_sum(wy);
  sums.AA << lane_sum(wA * A), A_one, A_one, lane_sum(w);
  sums.gr << lane_sum(wx * residual), lane_sum(wy * residual);
  sums.Ar << lane_sum(wA * residual), -lane_sum(w * residual);
  return value;
}

TILEFLIGHT_WIDE_VECTORS
RhoLinearization evaluate_rho(const Lens& lens, const PyramidLevel& target, const Patch& patch, float rho,
                              const PairTransform& pair, float huber) {
  RhoLinearization out;
  WarpedPatch warped;
  if (!warp_patch(lens, patch, pair.R, pair.t, rho, warped) || !pattern_inside(target, warped)) return out;
  const Eigen::Vector2f pixel_by_rho = warped.pixel_by_X * pair.t;
  PatternLanes lanes;
  sample_pattern(target, warped, lanes);
  Lanes host, weight, robust;
  load_lanes(patch.intensity.data(), host);
  load_lanes(patch.weight.data(), weight);
  const Lanes residual = lanes.grey - (pair.gain * host + pair.offset);
  huber_weights(residual, huber, robust);
  const Lanes w = weight * robust;
  const Lanes J = lanes.gx * pixel_by_rho.x() + lanes.gy * pixel_by_rho.y();
  out.energy = lane_sum(w * residual * residual * (2.0F - robust));
  out.H = lane_sum(w * J * J);
  out.b = lane_sum(w * J * residual);
  out.state = ResidualState::kGood;
  return out;
}

}  // namespace tileflight::odometry
