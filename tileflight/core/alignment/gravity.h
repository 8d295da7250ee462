#pragma once

#include <optional>

#include "tileflight/core/geometry/trajectory.h"

namespace tileflight::alignment {

/// Unit direction against gravity in the frame of a camera path. A camera on an upright vehicle yaws and pitches but
/// hardly rolls, so its x axis stays level: up is the direction most nearly perpendicular to all x axes, on the side of
/// the image tops. nullopt if the path does not determine it: the camera rotated by only a few degrees, or rolled as
/// much as it yawed.
std::optional<geometry::Vec3> estimate_up_from_trajectory(const geometry::Trajectory& trajectory);

}  // namespace tileflight::alignment
