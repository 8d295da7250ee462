#pragma once

#include <string>
#include <vector>

#include "tileflight/geometry/transform.h"

namespace tileflight::alignment {

/// A vector that changes with time, as one clock and one frame have it: a turning rate, or a velocity.
struct TimedVector {
  double time_s = 0.0;
  geometry::Vec3 value = geometry::Vec3::Zero();
};

struct TimeOffsetOptions {
  /// The second signal is the first one times an unknown factor too (a velocity in a map without scale).
  bool estimate_scale = false;
  double step_s = 0.1;           ///< both signals are averaged over this
  double least_overlap_s = 5.0;  ///< of the two signals; also half of the shorter one
  double least_gain = 8.0;       ///< log likelihood ratio by which the best offset beats no relation at all ...
  double least_lead = 4.5;       ///< ... and every other peak (three sigma)
};

/// Time of the first signal's clock minus time of the second's at the same moment.
struct TimeOffset {
  bool determined = false;
  double offset_s = 0.0;     ///< of the best peak, also where it is not determined
  double sigma_s = 0.0;      ///< from the curvature of the squares' sum and the residuals' correlation in time
  double explained = 0.0;    ///< share of the first signal's variance that the second explains
  double independent = 0.0;  ///< samples that count as independent
  geometry::Mat3 R_first_second = geometry::Mat3::Identity();
  double scale = 1.0;
  std::string reason;  ///< why it is not determined; empty where it is
};

/// The offset of two clocks by one motion that both have seen. At each offset the second signal is turned (and scaled)
/// to the first as well as it can be (Kabsch 1976), both about their means; the sum of squares that is left gives the
/// likelihood, with as many independent samples as the signals' correlation in time leaves (Bartlett 1935). The best
/// offset is searched over all that leave enough overlap, then refined by a parabola. Not determined, with the reason:
/// signals too short, without change, without relation, or with a second peak that is nearly as good (a motion that
/// repeats itself), or a best offset at the end of the range. Times strictly increase.
TimeOffset estimate_time_offset(const std::vector<TimedVector>& first, const std::vector<TimedVector>& second,
                                const TimeOffsetOptions& options = {});

}  // namespace tileflight::alignment
