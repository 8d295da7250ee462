#pragma once

#include "tileflight/report/figure.h"
#include "tileflight/report/run_folder.h"

namespace tileflight::report {

/// Where the colours of errors end, metres: the cut-off of the paper's metric.
double color_limit(const RunFolder& run);

// The pictures of the page, each with its caption and its files; empty where the run holds nothing to draw.

/// Frames of both flights side by side.
Figure frames_figure(const RunFolder& run);
/// Histograms of the kept distances over each other, with means and floor.
Figure histogram_figure(const RunFolder& run);
/// Share of map points within a distance of the surface.
Figure cumulative_figure(const RunFolder& run);
/// Truth in green, simulated map in blue, second map in red, from above.
Figure maps_figure(const RunFolder& run);
/// Estimated and true paths from above.
Figure paths_figure(const RunFolder& run);
/// Distance between estimated and true path over the distance flown.
Figure path_error_figure(const RunFolder& run);
/// How alike the views of a flight and of the one that follows it are, over time.
Figure overlap_figure(const RunFolder& run);
/// Each flight's map, coloured by its error.
Figure error_maps_figure(const RunFolder& run);

}  // namespace tileflight::report
