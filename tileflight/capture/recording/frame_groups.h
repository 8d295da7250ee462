#pragma once

#include <cstddef>
#include <vector>

#include "tileflight/core/geometry/transform.h"

namespace tileflight::recording {

/// A flight whose camera positions span at most this along each axis of the local frame is one group. Tiles of the
/// finest levels reach about as far from a camera, so a smaller flight would gain little from several selections.
inline constexpr double kSingleGroupSpan_m = 512.0;
/// Edge of the cubes that divide a longer flight. Tiles are refined for the nearest camera of a group, so larger cubes
/// need more memory; smaller ones need more acceleration structures, of which each group has its own.
inline constexpr double kGroupEdge_m = 256.0;
/// A frame this far outside the previous frame's cube still belongs to it, so that a path along a cube's face does not
/// alternate between two groups.
inline constexpr double kGroupMargin_m = 32.0;

/// The frames of a flight, divided into groups that each have their own selection of tiles.
struct FrameGroups {
  std::vector<std::size_t> group_of_frame;
  std::vector<std::vector<std::size_t>> frames;  ///< of each group, ascending; groups in order of their first frame
  /// Origin of a scene's float coordinates, for each group: the cube's centre, or the middle frame of a single group.
  std::vector<geometry::Vec3> anchors;

  std::size_t count() const { return frames.size(); }
};

/// Divides frames by camera position (local frame, at least one). It depends on nothing else, so neither does what is
/// rendered. A path that returns to a cube returns to its group.
FrameGroups group_frames(const std::vector<geometry::Vec3>& positions);

/// Returns all frames as one group.
FrameGroups single_group(const std::vector<geometry::Vec3>& positions);

}  // namespace tileflight::recording
