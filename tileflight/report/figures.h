#pragma once

#include "tileflight/report/html.h"
#include "tileflight/report/run_folder.h"

namespace tileflight::report {

// The pictures of the page, each a <figure> with its caption; empty markup where the run holds nothing to draw.

/// Frames of both flights side by side.
Html frames_figure(const RunFolder& run);
/// Histograms of the kept distances over each other, with means and floor.
Html histogram_figure(const RunFolder& run);
/// Share of map points within a distance of the surface.
Html cumulative_figure(const RunFolder& run);
/// Truth in green, simulated map in blue, second map in red, from above.
Html maps_figure(const RunFolder& run);
/// Estimated and true paths from above.
Html paths_figure(const RunFolder& run);
/// Each flight's map, coloured by its error.
Html error_maps_figure(const RunFolder& run);

}  // namespace tileflight::report
