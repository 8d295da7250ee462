#pragma once

#include <string>

#include "tileflight/report/place_model.h"
#include "tileflight/report/run_folder.h"

namespace tileflight::report {

/// What each layer of the view may take, so that the page stays below 15 MB: with these, all layers together are at
/// most about 9 MB, 12 MB in the page's base64.
struct ViewBudget {
  PlaceModelOptions place;
  std::size_t texture_bytes = 2'000'000;  ///< of the place's texture as JPEG
  std::size_t cells = 150'000;            ///< more: cells are joined, twice as wide, until they fit
  std::size_t map_points = 100'000;       ///< of each flight's map; more: evenly thinned out
  std::size_t poses = 1500;               ///< of each path; more: evenly thinned out
  std::size_t frames = 60;                ///< pictures of each flight
  int frame_width_px = 400;
  std::size_t frame_bytes = 1'000'000;  ///< of each flight's pictures together
};

/// What the interactive view shows, packed for the page (data_blocks.h; the header's members are the interfaces of
/// web/src/data.ts): the place's mesh, occupied cells, maps with their errors, paths, and pictures. Empty if the run
/// has none of place, cells, map and path. Deterministic. Throws InputError: a picture or the mesh is broken.
std::string view_data(const RunFolder& run, const ViewBudget& budget = {});

}  // namespace tileflight::report
