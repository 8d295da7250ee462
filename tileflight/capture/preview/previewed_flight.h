#pragma once

#include <cstdint>

#include "tileflight/world/place/place_reader.h"
#include "tileflight/capture/preview/flight_check.h"
#include "tileflight/capture/recording/planned_flight.h"
#include "tileflight/capture/recording/render_stage.h"

namespace tileflight::preview {

/// Settings of preview_flight().
struct PreviewSettings {
  recording::RenderSettings render;  ///< the flight as it will be rendered
  FlightCheckOptions check;
  int map_pixels = 1100;    ///< pixels along the ground's longer side
  int picture_width = 960;  ///< width of the written images
};

/// A flight, and the place under it.
struct PreviewedFlight {
  const PreviewSettings& settings;
  recording::PlannedFlight mission;
  place::PlaceReader place;
  std::uintmax_t memory;            ///< limit for tiles
  std::uintmax_t checks_bytes = 0;  ///< of it, taken by the tiles along the path; at most half

  const geometry::Trajectory& frames() const { return mission.frames; }
  std::uintmax_t memory_left() const { return memory - checks_bytes; }
  const geometry::SE3& pose(std::size_t i) const { return mission.frames.poses[i].T_local_camera; }
};

}  // namespace tileflight::preview
