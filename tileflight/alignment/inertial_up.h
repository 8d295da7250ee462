#pragma once

// Which way is up in a camera path's frame, by an accelerometer that was carried along.

#include <optional>
#include <vector>

#include "tileflight/alignment/evidence.h"
#include "tileflight/geometry/trajectory.h"

namespace tileflight::alignment {

/// What an accelerometer reads, turned into the camera's axes (x right, y down, z forwards): at rest 9.81 m/s^2 against
/// gravity.
struct SpecificForce {
  double time_s = 0.0;  ///< on the path's clock
  geometry::Vec3 force_m_s2 = geometry::Vec3::Zero();
};

/// Over a stretch of time the mean specific force is the mean acceleration, (v_1 - v_0) / (t_1 - t_0) with the path's
/// velocities v times its scale, plus gravity upwards: least squares over the stretches for gravity and the scale,
/// which need not be known. nullopt where path and readings have too little time in common, and where what comes out is
/// no gravity (other units, another clock; other axes, if the camera turned): its size must be within a twentieth of
/// 9.81 m/s^2. Axes that are stated wrongly do not show while the camera does not turn.
std::optional<UpDirection> up_of_specific_force(const geometry::Trajectory& T_map_camera,
                                                const std::vector<SpecificForce>& readings);

}  // namespace tileflight::alignment
