#pragma once

#include "tileflight/core/geometry/transform.h"

namespace tileflight::geometry {

/// The left Jacobian of SO(3) and its inverse: so3_exp(omega + d) = so3_exp(J d) so3_exp(omega) to first order in d.
/// Barfoot, State Estimation for Robotics, (7.37) and (7.38); the inverse for angles below 2 pi.
Mat3 so3_left_jacobian(const Vec3& omega_rad);
Mat3 so3_left_jacobian_inverse(const Vec3& omega_rad);

/// The right ones: so3_exp(omega + d) = so3_exp(omega) so3_exp(J d).
inline Mat3 so3_right_jacobian(const Vec3& omega_rad) { return so3_left_jacobian(-omega_rad); }
inline Mat3 so3_right_jacobian_inverse(const Vec3& omega_rad) { return so3_left_jacobian_inverse(-omega_rad); }

}  // namespace tileflight::geometry
