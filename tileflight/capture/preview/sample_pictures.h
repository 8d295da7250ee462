#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/capture/preview/previewed_flight.h"
#include "tileflight/core/imaging/image.h"

namespace tileflight::preview {

/// Tiles along a flight's path, against which it is checked.
struct SurroundingTiles {
  place::PlacePart part;    ///< without textures
  bool is_coarser = false;  ///< than half a percent of their distance, or less far around, for lack of memory
};

/// Reads tiles with an error of at most half a percent of their distance from the path; the first coarser level that
/// fits, where they need more than half of the memory. Throws tileset::MemoryLimitExceeded if none does.
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

/// The criterion of the tiles that `render` loads for the frames of a group at this screen-space error; nullopt: those
/// of the region. `frame`: for that one only.
tileset::RefinementCriterion criterion_of(const PreviewedFlight& flight, const std::vector<std::size_t>& group,
                                          const std::optional<double>& error_px, std::optional<std::size_t> frame = {});

/// The first, middle and last image, as `render` would make them, from the same tiles where they fit into memory,
/// otherwise from coarser ones (`error_px`). Tiles that could not be read are appended to `missing`.
std::vector<SamplePicture> render_pictures(PreviewedFlight& flight, std::vector<place::MissingTile>& missing,
                                           const Progress& progress);

}  // namespace tileflight::preview
