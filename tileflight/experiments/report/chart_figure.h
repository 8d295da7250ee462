#pragma once

#include <string>

#include "tileflight/core/drawing/chart.h"
#include "tileflight/core/drawing/drawing.h"

namespace tileflight::report {

/// A figure with the chart as SVG; its points are also written as CSV and to report.json.
drawing::Figure chart_figure(const std::string& id, const drawing::Chart& chart, const std::string& caption);

}  // namespace tileflight::report
