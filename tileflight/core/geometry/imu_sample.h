#pragma once

#include "tileflight/core/geometry/transform.h"

namespace tileflight::geometry {

/// A reading of an inertial unit, in its own axes. Sensors produce it, datasets store it, estimators consume it.
struct ImuSample {
  double time_s = 0.0;
  Vec3 angular_rate_rad_s = Vec3::Zero();
  Vec3 specific_force_m_s2 = Vec3::Zero();  ///< at rest: gravity upwards
};

/// Biases that an inertial unit adds to the true values.
struct ImuBias {
  Vec3 gyroscope_rad_s = Vec3::Zero();
  Vec3 accelerometer_m_s2 = Vec3::Zero();
};

}  // namespace tileflight::geometry
