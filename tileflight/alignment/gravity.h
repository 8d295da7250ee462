#pragma once

#include <optional>

#include "tileflight/geometry/trajectory.h"

namespace tileflight::alignment {

/// The direction against gravity in the frame of a camera's path, unit length: a camera that is carried upright turns
/// and pitches, but hardly rolls, so that its x axis stays level; up is the direction that all x axes are most nearly
/// at right angles to, on the side that the images' tops look to. nullopt where the path does not tell: the camera
/// never turned by more than a few degrees, or rolled as much as it turned.
std::optional<geometry::Vec3> up_of_trajectory(const geometry::Trajectory& trajectory);

}  // namespace tileflight::alignment
