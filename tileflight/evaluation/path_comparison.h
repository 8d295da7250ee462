#pragma once

#include "tileflight/evaluation/measured.h"

namespace tileflight::evaluation {

/// Path errors (ATE, metres) of two flights that were tracked once each. A path is one sample: its error is made of few
/// slow drifts, and no stretch of it is like another path. For drift of rotation, scale and position, each a random
/// walk, the squared error is spread as a chi-square with two degrees of freedom or more (docs/trust.md), so with two
/// the intervals are never too narrow: that of the ratio by Fisher's F(2, 2), that of the difference from each error's
/// own interval (Zou and Donner, Statistics in Medicine 27, 2008). `measured` has its margins; both are judged: the
/// paths count as the same within the ratio or within `or_within`.
void judge_one_path_each(double simulated_m, double real_m, Measured& measured);

}  // namespace tileflight::evaluation
