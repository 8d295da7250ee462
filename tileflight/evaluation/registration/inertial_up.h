#pragma once

// Up direction in the frame of a camera path, from an accelerometer on the same vehicle.

#include <optional>
#include <vector>

#include "tileflight/core/geometry/trajectory.h"
#include "tileflight/evaluation/registration/telemetry_estimate.h"

namespace tileflight::registration {

/// An accelerometer reading rotated into the camera's axes (x right, y down, z forward); at rest 9.81 m/s^2 upwards.
struct SpecificForce {
  double time_s = 0.0;  ///< on the path's clock
  geometry::Vec3 force_m_s2 = geometry::Vec3::Zero();
};

/// Over an interval the mean specific force equals the mean acceleration, (v_1 - v_0) / (t_1 - t_0) with the path's
/// velocities v times its scale, plus gravity directed upwards. Gravity and the unknown scale are estimated by least
/// squares over the intervals. nullopt if path and readings overlap too little in time, or if the estimated gravity is
/// not within a twentieth of 9.81 m/s^2 (wrong units or clock; wrong axes, if the camera rotated). Wrong axes are not
/// detected while the camera does not rotate.
std::optional<UpDirection> estimate_up_from_accelerometer(const geometry::Trajectory& T_map_camera,
                                                          const std::vector<SpecificForce>& readings);

}  // namespace tileflight::registration
