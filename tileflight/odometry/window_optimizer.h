#pragma once

// Joint optimisation of all poses, lights and inverse distances of the window: section 2.3.

#include "tileflight/odometry/keyframe.h"
#include "tileflight/odometry/options.h"

namespace tileflight::odometry {

struct WindowResult {
  double rmse = 0.0;  ///< of good residuals, grey values a pixel
  int good_residuals = 0;
  int iterations = 0;
};

/// Gauss-Newton with light damping; a step that does not lower the energy is taken back. Residuals above their
/// keyframes' threshold count with the threshold and pull at nothing. Where the window estimates the lens, `lens` may
/// be any lens of the camera: the window's own estimate of its intrinsics is taken, and rays of active points follow
/// it.
WindowResult optimize_window(Window& window, const Lens& lens, const WindowOptions& options, int iterations);

/// Moves the keyframe's linearisation point to its present value: allowed while the prior holds nothing of its pose.
void relinearize(Window& window, int slot);

/// The same for the lens, where it is estimated.
void relinearize_lens(Window& window);

/// After an optimisation: forgets residuals that are not good, updates points' counts, and removes points without any
/// residual left.
void remove_bad_residuals(Window& window);

/// Threshold on the energy of a keyframe's residuals, from their 70th percentile.
void update_energy_threshold(Window& window, int slot);

}  // namespace tileflight::odometry
