#pragma once

// Removal of bad residuals after an optimisation of the window.

#include "tileflight/slam/keyframes/keyframe.h"

namespace tileflight::mapping {

/// Removes residuals that are not good, updates the points' counts, and removes points without residuals. Call it
/// after an optimisation.
void remove_bad_residuals(keyframes::Window& window);

/// Sets the outlier threshold on a keyframe's residual energies from their 70th percentile.
void update_energy_threshold(keyframes::Window& window, int slot);

}  // namespace tileflight::mapping
