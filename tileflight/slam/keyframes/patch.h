#pragma once

// A point in its host image: its pixel, its ray, and the eight grey values around it that residuals compare.
//
// Notation (also of residual.h, tracer.h): a point on the unit ray r of its host at inverse distance rho has the
// direction
//   X = R r + rho t                                                              (T_target_host = (R, t), X = point *
//   rho)
// in a target. This holds beyond 180 degrees and for points at infinity (rho = 0). The other pattern pixels have the
// same inverse distance; they are mapped into the target by the derivative of the warp at the centre,
// d(pixel_target)/d(pixel_host).

#include <array>
#include <cmath>
#include <optional>

#include "tileflight/core/base/simd.h"
#include "tileflight/slam/keyframes/pyramid.h"

namespace tileflight::keyframes {

/// Residual pattern of eight pixels (DSO, figure 4).
inline constexpr int kPatternSize = 8;
inline constexpr std::array<std::array<float, 2>, kPatternSize> kPattern{
    {{0, -2}, {-1, -1}, {1, -1}, {-2, 0}, {0, 0}, {2, 0}, {-1, 1}, {0, 2}}};
inline constexpr float kPatternRadius_px = 2.0F;
/// Offsets of kPattern by coordinate.
inline constexpr base::Float8 kPatternX{0, -1, 1, -2, 0, 2, -1, 0};
inline constexpr base::Float8 kPatternY{-2, -1, -1, 0, 0, 0, 1, 2};
static_assert(kPatternSize == base::kLanes);

struct Patch {
  Eigen::Vector2f pixel = Eigen::Vector2f::Zero();  ///< level 0 of the host
  Eigen::Vector3f ray = Eigen::Vector3f::Zero();    ///< unit, host frame
  Eigen::Vector3f ray_linear =
      Eigen::Vector3f::Zero();  ///< the ray by the lens at its linearisation point (keyframe.h)
  Eigen::Matrix<float, 3, 2> d_ray_d_pixel =
      Eigen::Matrix<float, 3, 2>::Zero();               ///< derivative of the ray by the pixel
  std::array<float, kPatternSize> intensity{};          ///< host's grey values
  std::array<float, kPatternSize> weight{};             ///< c^2 / (c^2 + |grad I|^2), eq. 7
  Eigen::Matrix2f structure = Eigen::Matrix2f::Zero();  ///< sum of grad I grad I^T over the pattern
};

/// Makes the patch around a pixel; nullopt outside the lens's valid region or too close to the image border.
std::optional<Patch> make_patch(const PyramidLevel& level, const Lens& lens, const Eigen::Vector2f& pixel,
                                float gradient_weight);

/// Recomputes the patch's ray and its derivative for changed intrinsics; `ray_linear` stays.
void update_ray(const Lens& lens, Patch& patch);

/// Geometric and brightness transform from a host to a target: I_target = gain * I_host + offset.
struct PairTransform {
  Eigen::Matrix3f R = Eigen::Matrix3f::Identity();
  Eigen::Vector3f t = Eigen::Vector3f::Zero();
  float gain = 1.0F;
  float offset = 0.0F;
};

/// A patch projected into a target.
struct WarpedPatch {
  Eigen::Vector3f X;      ///< direction in the target, not normalised
  Eigen::Vector2f pixel;  ///< of the centre
  Eigen::Matrix<float, 2, 3> d_pixel_d_X;
  Eigen::Matrix2f d_pixel_d_host_pixel;  ///< of the pattern
};

/// False outside the lens's valid cone.
inline bool warp_patch(const Lens& lens, const Patch& patch, const Eigen::Matrix3f& R, const Eigen::Vector3f& t,
                       float rho, WarpedPatch& out) {
  out.X = R * patch.ray + rho * t;
  if (!lens.project<float>(out.X, out.pixel, out.d_pixel_d_X)) return false;
  out.d_pixel_d_host_pixel = out.d_pixel_d_X * (R * patch.d_ray_d_pixel);
  return true;
}

/// Returns whether the whole pattern can be sampled in the target.
inline bool pattern_inside(const PyramidLevel& target, const WarpedPatch& warped) {
  const float reach_x = kPatternRadius_px * warped.d_pixel_d_host_pixel.row(0).cwiseAbs().maxCoeff() + 1.0F;
  const float reach_y = kPatternRadius_px * warped.d_pixel_d_host_pixel.row(1).cwiseAbs().maxCoeff() + 1.0F;
  return warped.pixel.x() >= reach_x && warped.pixel.y() >= reach_y &&
         warped.pixel.x() < static_cast<float>(target.width - 1) - reach_x &&
         warped.pixel.y() < static_cast<float>(target.height - 1) - reach_y;
}

}  // namespace tileflight::keyframes
