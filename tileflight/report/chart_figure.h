#pragma once

#include <string>

#include "tileflight/report/chart.h"
#include "tileflight/report/figure.h"

namespace tileflight::report {

/// A figure with the chart as SVG; its points are also written as CSV and to report.json.
Figure chart_figure(const std::string& id, const Chart& chart, const std::string& caption);

}  // namespace tileflight::report
