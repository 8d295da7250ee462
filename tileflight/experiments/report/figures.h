#pragma once

#include "tileflight/core/drawing/drawing.h"
#include "tileflight/experiments/report/run_folder.h"

namespace tileflight::report {

/// Upper end of the error colour scale, metres: the cut-off of the paper's metric.
double color_limit(const RunFolder& run);

// The figures of the page, each with its caption and files; empty if the run has no data for it.

/// Corresponding frames of both flights side by side.
drawing::Figure frames_figure(const RunFolder& run);
/// Overlaid histograms of the distances below the cut-off, with means and quantization floor.
drawing::Figure histogram_figure(const RunFolder& run);
/// Share of map points within a distance of the surface.
drawing::Figure cumulative_figure(const RunFolder& run);
/// Map from above: truth in green, simulated map in blue, second map in red.
drawing::Figure maps_figure(const RunFolder& run);
/// Estimated and true paths from above.
drawing::Figure paths_figure(const RunFolder& run);
/// Distance between estimated and true path against distance flown.
drawing::Figure path_error_figure(const RunFolder& run);
/// View overlap and image similarity of a flight and the one that follows it, over time.
drawing::Figure overlap_figure(const RunFolder& run);
/// Each flight's map, coloured by its error.
drawing::Figure error_maps_figure(const RunFolder& run);

}  // namespace tileflight::report
