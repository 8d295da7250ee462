#pragma once

// Structure and motion of a segment, for a lens that may be wrong.
//
// Frame `segment`: the camera of the first keyframe, in units of the median distance of the first corners. A corner is
// a direction d and an inverse distance rho from there, so that corners at the horizon need no special case; its image
// in a camera is that of X = R d + rho t.

#include <optional>
#include <vector>

#include "tileflight/core/geometry/transform.h"
#include "tileflight/core/imaging/camera.h"
#include "tileflight/slam/self_calibration/corner_segments.h"

namespace tileflight::self_calibration {

/// Holds a corner of a segment.
struct StructurePoint {
  geometry::Vec3 direction = geometry::Vec3::UnitZ();  ///< unit
  double rho = 0.0;
  bool is_known = false;
  bool fits = false;  ///< whether it is known and its reprojections are small; else it follows the poses
};

/// Holds structure and motion of a segment.
struct SegmentStructure {
  std::vector<geometry::SE3> T_camera_segment;  ///< of the keyframes, from the first as far as they could be found
  /// Velocity of each keyframe, as a left increment of T_camera_segment in a second; for the rolling shutter.
  std::vector<geometry::Vec6> velocities;
  std::vector<StructurePoint> points;  ///< of each track
};

/// Finds structure and motion from two views, and adds the other keyframes one by one. nullopt if fewer than four
/// keyframes can be added.
std::optional<SegmentStructure> start_structure(const imaging::Camera& camera, const Segment& segment);

/// Determines the velocities from the images next to the keyframes.
void estimate_velocities(const imaging::Camera& camera, const Segment& segment, SegmentStructure& structure);

}  // namespace tileflight::self_calibration
