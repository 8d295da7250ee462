#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/capture/preview/flight_check.h"
#include "tileflight/capture/recording/planned_flight.h"
#include "tileflight/capture/recording/render_stage.h"
#include "tileflight/core/imaging/image.h"
#include "tileflight/world/place/place_reader.h"

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
  bool lacks_textures = false;      ///< whether its images are shaded by relief_light(); set by look_at_place()

  const geometry::Trajectory& frames() const { return mission.frames; }
  std::uintmax_t memory_left() const { return memory - checks_bytes; }
  const geometry::SE3& pose(std::size_t i) const { return mission.frames.poses[i].T_local_camera; }
};

/// Finds out, from some of the tiles that `render` would show, whether they have textures and lie inside of their
/// volumes, which the other functions then take into account.
void look_at_place(PreviewedFlight& flight);

/// Tiles along a flight's path, against which it is checked.
struct SurroundingTiles {
  place::PlacePart part;    ///< without textures
  bool is_coarser = false;  ///< than half a percent of their distance, or less far around, for lack of memory
};

/// Reads tiles with an error of at most half a percent of their distance from the path. If they need more than half of
/// the memory, the first coarser level that fits is read. Throws tileset::MemoryLimitExceeded if none does.
SurroundingTiles read_surroundings(PreviewedFlight& flight, const Progress& progress);

/// An image of the flight, and its cost.
struct SamplePicture {
  std::string name;
  std::size_t frame = 0;
  imaging::RgbImage thumbnail;
  double surface_share = 0.0;
  std::int64_t tiles = 0;
  std::uintmax_t file_bytes = 0, memory_bytes = 0;
  double load_s = 0.0, render_s = 0.0, encode_s = 0.0;
  std::optional<double> error_px;  ///< of its tiles, if the flight's views select them
};

/// Returns the criterion by which `render` selects tiles for the frames of a group at this screen-space error; without
/// an error, that of the region. `frame`: only for this frame.
tileset::RefinementCriterion criterion_of(const PreviewedFlight& flight, const std::vector<std::size_t>& group,
                                          const std::optional<double>& error_px, std::optional<std::size_t> frame = {});

/// Renders the first, middle and last image as `render` would make them, from the same tiles where they fit into
/// memory, otherwise from coarser ones (`error_px`). Tiles that could not be read are appended to `missing`.
std::vector<SamplePicture> render_pictures(PreviewedFlight& flight, std::vector<place::MissingTile>& missing,
                                           const Progress& progress);

}  // namespace tileflight::preview
