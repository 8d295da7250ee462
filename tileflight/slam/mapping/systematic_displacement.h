#pragma once

namespace tileflight::mapping {

/// Displacement common to the points of both halves of the keyframes (systematic_residuals.h).
struct SystematicDisplacement {
  double rms_px = 0.0;  ///< perpendicular to the motion in the image, over the cells; 0 if the halves disagree
  double sigmas = 0.0;  ///< its square over the standard deviation of that square without a systematic pattern
};

}  // namespace tileflight::mapping
