#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/capture/render/orthophoto.h"
#include "tileflight/core/drawing/place_map.h"
#include "tileflight/world/place/place_reader.h"

namespace tileflight::preview {

/// An orthophoto of a place with its heights, as far as its tiles cover it.
struct GroundView {
  render::GroundGrid grid;
  render::Orthophoto image;
  std::vector<place::MissingTile> missing;
  std::int64_t tiles = 0;
  std::int64_t triangles = 0;  ///< of the tiles read, whether seen from above or not
  std::int64_t parts = 0;      ///< number of parts in which the image was rendered, one after the other
  double error_m = 0.0;        ///< requested geometric error
  bool is_coarser = false;     ///< somewhere coarser tiles were used for lack of memory
};

/// Options of render_ground_view().
struct GroundViewOptions {
  double error_m = 0.0;                ///< requested geometric error
  render::OrthophotoOptions top_down;  ///< which heights are included
  std::uintmax_t max_memory_bytes = 0;
};

/// Renders the part of `place` within the grid from above. If the tiles of a part exceed the memory limit, it is
/// rendered in quarters, and a part that is already small is rendered from coarser tiles, so that memory does not grow
/// with the size of the place. Throws InputError (tileset::MemoryLimitExceeded) if even that does not fit.
GroundView render_ground_view(place::PlaceReader& place, const render::GroundGrid& grid,
                              const GroundViewOptions& options, const Progress& progress);

/// Computes the bounding box of all surfaces and points of a region, from tiles with a geometric error of at most
/// `error_m`; empty if there are none. Tiles' bounding volumes are often much larger than their content.
geometry::Box3 surface_bounds(place::PlaceReader& place, double error_m, std::uintmax_t max_memory_bytes,
                              const Progress& progress);

/// Returns a grid of square pixels over a box of the ground, with `pixels` along its longer side; the shorter side is
/// at least a third of it.
render::GroundGrid fit_ground_grid(const geometry::Box3& box, int pixels);

/// Convert the view for a map: extent, colours and heights; and the outlines of missing tiles.
drawing::GroundImage to_ground_picture(const GroundView& view);
std::vector<drawing::MapOutline> missing_outlines(const GroundView& view);

/// Lists warnings about the view: missing tiles, coarser ones.
std::vector<std::string> ground_view_warnings(const GroundView& view);

}  // namespace tileflight::preview
