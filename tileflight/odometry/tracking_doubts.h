#pragma once

// What may be wrong with a flight as it was tracked, from the pictures alone.

#include <functional>
#include <optional>

#include "tileflight/geometry/doubt.h"
#include "tileflight/odometry/odometry.h"
#include "tileflight/odometry/second_opinion.h"

namespace tileflight::odometry {

/// From what on something is doubted. Found on the proving ground's flights (docs/algorithms.md has the figures).
struct DoubtLimits {
  double least_tracked_share = 0.95;  ///< of the pictures
  std::int64_t least_pictures = 20;   ///< tracked: fewer say little of anything
  double saturated_share = 0.13;      ///< of a picture's points, residual above the cut-off
  double sigma_log_scale = 0.0013;    ///< of the scale at the end over that at the start
  double velocity_change = 1.5;       ///< between two pictures, in units of the flight's 95th percentile of speed
  double pattern_px = 0.04;  ///< of the displacement that keyframes have in common; from `pattern_likely_px` on
                             ///< it is more than a possible doubt
  double pattern_likely_px = 0.15;
  double pattern_sigmas = 2.0;
  double disagreement = 0.007;  ///< of forwards and backwards, as a share of the path
};

/// The doubts, most certain first; none for a flight that went well. `frames`: pictures there were; `name_of`: a
/// picture's name from its InputFrame::index. `second`: how far another run agrees; none where there was no other.
Doubts doubts_of(const OdometryResult& result, std::int64_t frames,
                 const std::function<std::string(std::int64_t)>& name_of, const std::optional<Agreement>& second = {},
                 const DoubtLimits& limits = {});

/// Which of two runs over the same pictures is to be gone by.
enum class Belief {
  kFirst,   ///< the second agrees, says too little, or is the worse one by itself
  kSecond,  ///< the first has far fewer poses, or is the worse one by itself
  kOpen     ///< they disagree, and neither is better by itself: the first, with a doubt
};

/// A run is the worse one by itself where it has doubts that the other has not, and fits worse by a tenth (median of
/// the pictures' residuals). `agreement`: of both trajectories at the same times.
Belief belief(const OdometryResult& first, const OdometryResult& second, const std::optional<Agreement>& agreement,
              const DoubtLimits& limits = {});

}  // namespace tileflight::odometry
