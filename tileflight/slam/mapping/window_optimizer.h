#pragma once

// Joint optimisation of all poses, brightness parameters, inverse distances and, if estimated, intrinsics of the
// window: DSO, section 2.3.

#include "tileflight/slam/keyframes/keyframe.h"
#include "tileflight/slam/keyframes/options.h"

namespace tileflight::mapping {

class InertialWindow;

struct WindowResult {
  double rmse = 0.0;  ///< of good residuals, grey values per pixel
  int good_residuals = 0;
  int iterations = 0;
};

/// Gauss-Newton with light damping; a step that raises the energy is undone. Residuals above their keyframes' threshold
/// contribute the threshold to the energy and nothing to the gradient. If the window estimates intrinsics, `lens` may
/// be any lens of the camera: the window's own intrinsics are applied to it, and rays of active points are updated.
/// `inertial`: readings that are part of the problem, with their own unknowns and a prior that replaces the window's;
/// null: none.
WindowResult optimize_window(keyframes::Window& window, const keyframes::Lens& lens,
                             const keyframes::WindowOptions& options, int iterations,
                             InertialWindow* inertial = nullptr);

/// Moves the keyframe's linearisation point to its present value; allowed only while the prior does not depend on its
/// pose.
void relinearize(keyframes::Window& window, int slot);

/// Same for the intrinsics, if they are estimated.
void relinearize_intrinsics(keyframes::Window& window);

}  // namespace tileflight::mapping
