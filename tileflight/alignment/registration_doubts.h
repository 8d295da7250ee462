#pragma once

#include "tileflight/alignment/register_map.h"

namespace tileflight::alignment {

/// Everything that speaks against a registration, in words: see docs/trust.md for the thresholds and how often they are
/// right.
void add_registration_doubts(const ObservedPoints& points, const RegistrationEvidence& evidence,
                             Registration& registration);

}  // namespace tileflight::alignment
