#pragma once

#include <cstddef>
#include <functional>
#include <vector>

#include "tileflight/core/alignment/similarity_chart.h"

namespace tileflight::alignment {

/// Standard deviation of an estimated similarity, measured as displacement of the points (RMS over points and noise),
/// by leaving out one of `groups` parts of the data at a time (delete-a-group jackknife: Kott, J. Official Statistics
/// 17(4), 2001): (g - 1) / g sum over the groups of the squared motion between the estimate without the group and the
/// mean of all such, the latter approximated by `whole`. If the groups are intervals of time, errors correlated in time
/// are accounted for. `without(group)` estimates from the rest. NaN for fewer than two groups.
double jackknife_sigma_m(const geometry::Sim3& whole, std::size_t groups, const PointSpread& points,
                         const std::function<geometry::Sim3(std::size_t group)>& without);

}  // namespace tileflight::alignment
