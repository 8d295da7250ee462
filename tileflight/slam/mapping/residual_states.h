#pragma once

// What an optimisation of the window leaves of its residuals.

#include "tileflight/slam/keyframes/keyframe.h"

namespace tileflight::mapping {

/// After an optimisation: removes residuals that are not good, updates the points' counts, and removes points without
/// residuals.
void remove_bad_residuals(keyframes::Window& window);

/// Sets the outlier threshold on a keyframe's residual energies from their 70th percentile.
void update_energy_threshold(keyframes::Window& window, int slot);

}  // namespace tileflight::mapping
