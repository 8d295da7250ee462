#pragma once

#include "tileflight/evaluation/metrics/compared_metric.h"

namespace tileflight::metrics {

/// Compares the path errors (ATE, metres) of two flights tracked once each. A path is one sample: its error consists of
/// a few slow drifts, and its segments are not independent samples. If rotation, scale and position drift as random
/// walks, the squared error is distributed as a chi-square with at least two degrees of freedom (docs/trust.md), so
/// with two the intervals are never too narrow: the ratio's by Fisher's F(2, 2), the difference's from the intervals of
/// both errors (Zou and Donner, Statistics in Medicine 27, 2008). The margins in `measured` are used; the paths are
/// equivalent within the ratio or within `absolute_margin`.
void judge_single_paths(double simulated_m, double real_m, ComparedMetric& measured);

}  // namespace tileflight::metrics
