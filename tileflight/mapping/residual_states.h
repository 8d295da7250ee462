#pragma once

// What an optimisation of the window leaves of its residuals.

#include "tileflight/photometry/keyframe.h"

namespace tileflight::mapping {

/// After an optimisation: removes residuals that are not good, updates the points' counts, and removes points without
/// residuals.
void remove_bad_residuals(photometry::Window& window);

/// Sets the outlier threshold on a keyframe's residual energies from their 70th percentile.
void update_energy_threshold(photometry::Window& window, int slot);

}  // namespace tileflight::mapping
