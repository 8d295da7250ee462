#pragma once

#include <functional>
#include <limits>

#include "tileflight/core/alignment/similarity_chart.h"

namespace tileflight::alignment {

/// Evaluation of a transform: its cost, and the next transform of the plain iteration.
struct Evaluation {
  double cost = 0.0;  ///< sum over the points of min(distance, radius)^2; the plain point-to-point step never increases
                      ///< it
  double rms_m = 0.0;  ///< RMS distance of the matched points
  std::size_t matched = 0;
  geometry::Sim3 next;  ///< the plain iteration's next transform
};

using EvaluateFunction = std::function<Evaluation(const geometry::Sim3&)>;

struct StepRule {
  bool accelerate = false;
  double cost_tolerance = 1e-12;  ///< relative increase of the cost that is tolerated
  int max_halvings = 5;           ///< maximum halvings of a plain step that raises the cost
};

struct StopRule {
  double rms_change_m = 0.0;  ///< stop if the RMS changes by less than this; 0: never
  double step_m = 0.0;        ///< stop if the plain step would move the points by less than this (RMS); 0: never
  int max_iterations = 0;
};

struct FixedPointResult {
  geometry::Sim3 T;
  Evaluation evaluation;  ///< at T
  int iterations = 0;
  bool stopped_by_rule = false;
  double last_step_m =
      std::numeric_limits<double>::infinity();  ///< RMS distance by which the plain step from T would move the points
};

/// Iterates T <- evaluate(T).next, optionally with Anderson acceleration. A step that raises the cost is rejected: an
/// accelerated step falls back to the plain step, and that one is halved a few times. `points` and `length_m` define
/// the size of motions (see SimilarityChart).
FixedPointResult iterate_fixed_point(const EvaluateFunction& evaluate, const geometry::Sim3& start,
                                     const StepRule& step, const StopRule& stop, const PointSpread& points,
                                     double length_m);

}  // namespace tileflight::alignment
