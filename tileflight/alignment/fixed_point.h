#pragma once

#include <functional>
#include <limits>

#include "tileflight/alignment/similarity_chart.h"

namespace tileflight::alignment {

/// One look at a transform: how good it is, and what the plain iteration makes of it.
struct Evaluation {
  double cost = 0.0;  ///< sum over the points of min(distance, radius)^2; the plain point-to-point step never raises it
  double rms_m = 0.0;  ///< over the matched points
  std::size_t matched = 0;
  geometry::Sim3 next;  ///< the plain iteration's next transform
};

using Evaluate = std::function<Evaluation(const geometry::Sim3&)>;

struct StepRule {
  bool accelerate = false;
  double slack = 1e-12;  ///< relative rise of the cost that still counts as none
  int halvings = 5;      ///< of a plain step that raises the cost
};

struct StopRule {
  double rms_change_m = 0.0;  ///< stop when the RMS changes by less; 0: never
  double step_m = 0.0;        ///< stop when the plain step would move the points by less (RMS); 0: never
  int max_iterations = 0;
};

struct FixedPointResult {
  geometry::Sim3 T;
  Evaluation evaluation;  ///< at T
  int iterations = 0;
  bool stopped_by_rule = false;
  double last_step_m =
      std::numeric_limits<double>::infinity();  ///< how far the plain step from T would move the points (RMS)
};

/// Iterates T <- evaluate(T).next, with Anderson acceleration if asked for. A step that raises the cost is not taken:
/// an accelerated one falls back to the plain one, that one is halved a few times. `points` and `length_m` measure
/// motions (see SimilarityChart).
FixedPointResult iterate(const Evaluate& evaluate, const geometry::Sim3& start, const StepRule& step,
                         const StopRule& stop, const PointSpread& points, double length_m);

}  // namespace tileflight::alignment
