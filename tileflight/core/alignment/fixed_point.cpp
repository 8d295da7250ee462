#include "tileflight/core/alignment/fixed_point.h"

#include <cmath>
#include <optional>

#include "tileflight/core/alignment/anderson.h"

namespace tileflight::alignment {

using geometry::Sim3;

namespace {

struct Candidate {
  Sim3 T;
  Evaluation evaluation;
};

/// Iteration that never increases the cost.
class MonotoneIteration {
 public:
  MonotoneIteration(const EvaluateFunction& evaluate, const Sim3& start, const StepRule& rule, double length_m)
      : evaluate_(evaluate), rule_(rule), chart_(start, length_m), current_{start, evaluate(start)} {}

  const Candidate& current() const { return current_; }

  void step() {
    if (rule_.accelerate && take_accelerated()) return;
    take_plain();
  }

 private:
  bool is_acceptable(const Evaluation& e) const {
    return e.matched > 0 && e.cost <= current_.evaluation.cost * (1.0 + rule_.cost_tolerance);
  }

  bool take_accelerated() {
    const Sim3 T =
        chart_.similarity(anderson_.next(chart_.coordinates(current_.T), chart_.coordinates(current_.evaluation.next)));
    const Evaluation e = evaluate_(T);
    if (!is_acceptable(e)) {
      anderson_.reset();
      return false;
    }
    current_ = {T, e};
    return true;
  }

  /// Takes the plain step, halved until it does not raise the cost; the last halving is taken in any case.
  void take_plain() {
    const geometry::Vec7 from = chart_.coordinates(current_.T);
    const geometry::Vec7 step = chart_.coordinates(current_.evaluation.next) - from;
    Candidate candidate{current_.evaluation.next, evaluate_(current_.evaluation.next)};
    for (int k = 1; k <= rule_.max_halvings && !is_acceptable(candidate.evaluation); ++k) {
      candidate.T = chart_.similarity(from + std::ldexp(1.0, -k) * step);
      candidate.evaluation = evaluate_(candidate.T);
    }
    current_ = candidate;
  }

  const EvaluateFunction& evaluate_;
  StepRule rule_;
  SimilarityChart chart_;
  AndersonAcceleration anderson_;
  Candidate current_;
};

}  // namespace

FixedPointResult iterate_fixed_point(const EvaluateFunction& evaluate, const Sim3& start, const StepRule& step,
                                     const StopRule& stop, const PointSpread& points, double length_m) {
  MonotoneIteration walk(evaluate, start, step, length_m);
  FixedPointResult result;
  std::optional<double> previous_rms_m;
  while (walk.current().evaluation.matched > 0) {
    const Evaluation& e = walk.current().evaluation;
    result.last_step_m = rms_motion_m(walk.current().T, e.next, points);
    const bool same_rms = previous_rms_m && std::abs(e.rms_m - *previous_rms_m) < stop.rms_change_m;
    if (same_rms || result.last_step_m < stop.step_m) {
      result.stopped_by_rule = true;
      break;
    }
    if (result.iterations >= stop.max_iterations) break;
    previous_rms_m = e.rms_m;
    walk.step();
    ++result.iterations;
  }
  result.T = walk.current().T;
  result.evaluation = walk.current().evaluation;
  return result;
}

}  // namespace tileflight::alignment
