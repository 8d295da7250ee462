#include "tileflight/odometry/residual.h"

namespace tileflight::odometry {
namespace {

/// Geometric derivatives at the first estimate; false when it projects outside the lens.
bool linearize_geometry(const Lens& lens, const Patch& patch, float rho, const ResidualFrame& frame,
                        Linearization& out) {
  const Eigen::Vector3f X = frame.R_linear * patch.ray + rho * frame.t_linear;
  Eigen::Vector2f pixel;
  Eigen::Matrix<float, 2, 3> pixel_by_X;
  if (!lens.project<float>(X, pixel, pixel_by_X)) return false;
  pixel_derivatives<float>(pixel_by_X, X, frame.t_linear, rho, out.pixel_by_pose, out.pixel_by_rho);
  return true;
}

}  // namespace

ResidualValue evaluate_residual(const Lens& lens, const PyramidLevel& target, const Patch& patch, float rho,
                                const ResidualFrame& frame, float huber, Linearization* linearization) {
  ResidualValue value;
  WarpedPatch warped;
  if (!warp_patch(lens, patch, frame.current.R, frame.current.t, rho, warped) || !pattern_inside(target, warped)) {
    return value;
  }
  if (linearization != nullptr && !linearize_geometry(lens, patch, rho, frame, *linearization)) return value;
  PatternSums sums;
  for (int k = 0; k < kPatternSize; ++k) {
    const Eigen::Vector2f p = pattern_pixel(warped, k);
    const Texel texel = target.sample(p.x(), p.y());
    const float residual = texel[kIntensity] - (frame.current.gain * patch.intensity[k] + frame.current.offset);
    const float robust = huber_weight(residual, huber);
    const float w = patch.weight[k] * robust;
    value.energy += w * residual * residual * (2.0F - robust);
    if (linearization == nullptr) continue;
    const Eigen::Vector2f g(texel[kGradX], texel[kGradY]);
    const Eigen::Vector2f A(-frame.gain_linear * (patch.intensity[k] - frame.host_b_linear), -1.0F);
    const Eigen::Vector2f wg = w * g;
    sums.gg += wg * g.transpose();
    sums.gA += wg * A.transpose();
    sums.AA += (w * A) * A.transpose();
    sums.gr += wg * residual;
    sums.Ar += A * (w * residual);
  }
  if (linearization != nullptr) linearization->sums = sums;
  value.state = ResidualState::kGood;
  return value;
}

RhoLinearization evaluate_rho(const Lens& lens, const PyramidLevel& target, const Patch& patch, float rho,
                              const PairTransform& pair, float huber) {
  RhoLinearization out;
  WarpedPatch warped;
  if (!warp_patch(lens, patch, pair.R, pair.t, rho, warped) || !pattern_inside(target, warped)) return out;
  const Eigen::Vector2f pixel_by_rho = warped.pixel_by_X * pair.t;
  for (int k = 0; k < kPatternSize; ++k) {
    const Eigen::Vector2f p = pattern_pixel(warped, k);
    const Texel texel = target.sample(p.x(), p.y());
    const float residual = texel[kIntensity] - (pair.gain * patch.intensity[k] + pair.offset);
    const float robust = huber_weight(residual, huber);
    const float w = patch.weight[k] * robust;
    const float J = texel[kGradX] * pixel_by_rho.x() + texel[kGradY] * pixel_by_rho.y();
    out.energy += w * residual * residual * (2.0F - robust);
    out.H += w * J * J;
    out.b += w * J * residual;
  }
  out.state = ResidualState::kGood;
  return out;
}

}  // namespace tileflight::odometry
