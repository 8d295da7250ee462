#pragma once

#include <string>

#include "tileflight/core/drawing/html.h"
#include "tileflight/experiments/report/run_folder.h"
#include "tileflight/tiles/simplification/place_model.h"

namespace tileflight::report {

/// Size limits of the view's layers that keep the page below 15 MB: with the defaults all layers together are at most
/// about 9 MB, 12 MB in the page's base64.
struct ViewBudget {
  simplification::PlaceModelOptions place;
  std::size_t max_texture_bytes = 2'000'000;  ///< of the place's texture as JPEG
  std::size_t max_cells = 150'000;            ///< beyond it, cells are merged into cells twice as wide until they fit
  std::size_t max_map_points = 100'000;       ///< per flight's map; beyond it, points are evenly subsampled
  std::size_t max_poses = 1500;               ///< per path; beyond it, poses are evenly subsampled
  std::size_t max_frames = 60;                ///< images per flight, of all cameras of a rig together
  int frame_width_px = 400;
  std::size_t max_frame_bytes = 1'000'000;  ///< for all images of a flight together
};

/// Returns the data of the interactive view, packed for the page (view_data.cpp; the header's members are the
/// interfaces of web/src/data.ts): the place's mesh, occupied cells, maps with their errors, paths, and images. Empty
/// if the run has neither place, cells, map nor path. Deterministic. Throws InputError if an image or the mesh is
/// broken.
std::string view_data(const RunFolder& run, const ViewBudget& budget = {});

/// Returns the page's section with the interactive view and its data, and a note for browsers without scripts; empty if
/// the program was built without the view or the run has no data for it.
drawing::Html view_section(const RunFolder& run, const ViewBudget& budget = {});

/// Returns the view's script, for the end of the page.
drawing::Html view_script();

/// Returns the Content Security Policy of a page with this script: nothing is loaded and no other script runs, whatever
/// names and files contain (Content Security Policy Level 3: the script is identified by its hash).
std::string content_policy();

/// Returns the <head> of a page of this name: style sheet and policy.
drawing::Html page_head(const std::string& name);

}  // namespace tileflight::report
