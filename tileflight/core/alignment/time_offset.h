#pragma once

#include <string>
#include <vector>

#include "tileflight/core/geometry/transform.h"

namespace tileflight::alignment {

/// Sample of a vector-valued signal in one clock and one frame, such as an angular rate or a velocity.
struct TimedVector {
  double time_s = 0.0;
  geometry::Vec3 value = geometry::Vec3::Zero();
};

struct TimeOffsetOptions {
  /// Also estimate an unknown factor between the signals (a velocity in a map without scale).
  bool estimate_scale = false;
  double step_s = 0.1;                   ///< both signals are averaged over windows of this length
  double min_overlap_s = 5.0;            ///< minimum overlap of the two signals; also at least half of the shorter one
  double min_log_likelihood_gain = 8.0;  ///< log likelihood ratio by which the best offset beats no relation at all ...
  double min_log_likelihood_lead = 4.5;  ///< ... and every other peak (three sigma)
};

/// Clock of the first signal minus clock of the second, at the same instant.
struct TimeOffset {
  bool determined = false;
  double offset_s = 0.0;             ///< of the best peak, even if not determined
  double sigma_s = 0.0;              ///< from the curvature of the sum of squares and the residuals' autocorrelation
  double explained_variance = 0.0;   ///< share of the first signal's variance explained by the second
  double independent_samples = 0.0;  ///< effective number of independent samples
  geometry::Mat3 R_first_second = geometry::Mat3::Identity();
  double scale = 1.0;
  std::string reason;  ///< why it is not determined; empty if it is
};

/// Estimates the offset of two clocks from a motion recorded with both. At each offset the second signal is rotated
/// (and scaled) to fit the first best (Kabsch 1976), both about their means; the remaining sum of squares gives the
/// likelihood, with the effective number of independent samples by the signals' autocorrelation (Bartlett 1935). The
/// best offset is searched over all with enough overlap, then refined by a polynomial fit. It is not determined, with
/// the reason given, if the signals are too short, constant or unrelated, if a second peak is nearly as good (a
/// periodic motion), or if the best offset is at the end of the range. Times must strictly increase.
TimeOffset estimate_time_offset(const std::vector<TimedVector>& first, const std::vector<TimedVector>& second,
                                const TimeOffsetOptions& options = {});

}  // namespace tileflight::alignment
