#pragma once

#include <vector>

namespace tileflight::metrics {

/// Kolmogorov-Smirnov statistic of two samples: the largest difference of their empirical distribution functions.
/// Neither may be empty.
double ks_statistic(std::vector<double> a, std::vector<double> b);

/// 1-Wasserstein distance of two samples: the area between their empirical distribution functions, in the samples'
/// unit. Neither may be empty.
double wasserstein_distance(std::vector<double> a, std::vector<double> b);

}  // namespace tileflight::metrics
