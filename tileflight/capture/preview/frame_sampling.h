#pragma once

#include <cstddef>
#include <vector>

#include "tileflight/capture/preview/coverage.h"
#include "tileflight/core/geometry/trajectory.h"
#include "tileflight/core/imaging/camera.h"

namespace tileflight::preview {

/// The flight's lens and the sampled poses.
struct FrameSampling {
  imaging::Camera camera;
  geometry::Trajectory trajectory;
  std::vector<std::size_t> frames;  ///< indices into trajectory

  const geometry::SE3& pose(std::size_t i) const { return trajectory.poses[frames[i]].T_local_camera; }
};

/// Frames evenly spread over the flight. Throws InputError.
FrameSampling sample_frames(const CoverageSettings& settings);

/// The same lens with images of this width, if its own are wider.
imaging::Camera scale_to_width(const imaging::Camera& camera, int width);

}  // namespace tileflight::preview
