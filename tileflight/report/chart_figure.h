#pragma once

#include <string>

#include "tileflight/report/chart.h"
#include "tileflight/report/figure.h"

namespace tileflight::report {

/// A chart as a figure of the page, with its SVG, its points as CSV and in report.json.
Figure chart_figure(const std::string& id, const Chart& chart, const std::string& caption);

}  // namespace tileflight::report
