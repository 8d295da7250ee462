#pragma once

#include "tileflight/evaluation/registration/register_map.h"

namespace tileflight::registration {

/// A path segment is reported as wrong if its images were located farther from it than this share of the path length
/// and than this distance.
inline constexpr double kSegmentErrorShare = 0.02, kMinSegmentError_m = 0.05;

/// Adds the warnings about a registration; docs/trust.md gives the thresholds and how often they are right.
void add_registration_warnings(const ObservedPoints& points, const RegistrationEvidence& evidence,
                               RegistrationResult& registration);

}  // namespace tileflight::registration
