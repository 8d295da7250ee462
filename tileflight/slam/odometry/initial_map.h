#pragma once

// Makes the first map from the images before it, and the state with which tracking begins.

#include <cstddef>
#include <deque>
#include <memory>
#include <optional>
#include <vector>

#include "tileflight/slam/initialization/initializer.h"
#include "tileflight/slam/mapping/mapper.h"
#include "tileflight/slam/odometry/preprocessor.h"
#include "tileflight/slam/odometry/tracking_log.h"
#include "tileflight/slam/odometry/tracking_state.h"

namespace tileflight::odometry {

/// State before the map: the search for a first motion, and the images that it may still use.
struct InitializationState {
  initialization::Initializer initializer;
  std::deque<InputFrame> frames;
  std::size_t first = 0;  ///< the initializer's number of frames.front()

  /// Drops images that the initializer no longer needs, the oldest first, while more than `limit_mb` megabytes are
  /// kept.
  void drop_unneeded(double limit_mb);
  /// Position in `frames` of the reference image of an initialization.
  std::size_t reference_position(const initialization::InitializationResult& start) const {
    return start.first_frame - first;
  }
};

struct InitialMap {
  TrackingState tracking;
  std::vector<TrackedFrame> tracked;   ///< images with a pose, in order of time
  std::vector<std::size_t> keyframes;  ///< positions in InitializationState::frames of the window's keyframes
};

/// A map from the last image of `state` alone, metric by the rig's other cameras: its first keyframe. nullopt if they
/// show too few distances.
std::optional<InitialMap> make_stereo_map(const InitializationState& state,
                                          const std::shared_ptr<const keyframes::Pyramid>& pyramid,
                                          Preprocessor& preprocessor, mapping::Mapper& mapper);

/// Makes the first keyframes and aligns the images between them. With a rolling shutter, the images of `state` that
/// belong to the initialization are rectified in place.
InitialMap make_initial_map(const initialization::InitializationResult& start, InitializationState& state,
                            Preprocessor& preprocessor, mapping::Mapper& mapper,
                            const keyframes::OdometryOptions& options);

}  // namespace tileflight::odometry
