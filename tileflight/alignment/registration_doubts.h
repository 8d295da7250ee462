#pragma once

#include "tileflight/alignment/register_map.h"

namespace tileflight::alignment {

/// A stretch of the path is off, and said to be, where its pictures were found farther from it than this share of the
/// path's length, and at least so far.
inline constexpr double kPartOffShare = 0.02, kPartOffLeast_m = 0.05;

/// Everything that speaks against a registration, in words: see docs/trust.md for the thresholds and how often they are
/// right.
void add_registration_doubts(const ObservedPoints& points, const RegistrationEvidence& evidence,
                             Registration& registration);

}  // namespace tileflight::alignment
