#include "tileflight/alignment/fixed_point.h"

#include <cmath>
#include <optional>

#include "tileflight/alignment/anderson.h"

namespace tileflight::alignment {

using geometry::Sim3;

namespace {

struct Candidate {
  Sim3 T;
  Evaluation evaluation;
};

/// Moving along from one transform to the next without letting the cost rise.
class Walk {
 public:
  Walk(const Evaluate& evaluate, const Sim3& start, const StepRule& rule, double length_m)
      : evaluate_(evaluate), rule_(rule), chart_(start, length_m), at_{start, evaluate(start)} {}

  const Candidate& at() const { return at_; }

  void step() {
    if (rule_.accelerate && take_accelerated()) return;
    take_plain();
  }

 private:
  bool acceptable(const Evaluation& e) const {
    return e.matched > 0 && e.cost <= at_.evaluation.cost * (1.0 + rule_.slack);
  }

  bool take_accelerated() {
    const Sim3 T =
        chart_.similarity(anderson_.next(chart_.coordinates(at_.T), chart_.coordinates(at_.evaluation.next)));
    const Evaluation e = evaluate_(T);
    if (!acceptable(e)) {
      anderson_.reset();
      return false;
    }
    at_ = {T, e};
    return true;
  }

  /// The full step, or the longest of its halves that does not raise the cost; the last one is taken in any case.
  void take_plain() {
    const geometry::Vec7 from = chart_.coordinates(at_.T);
    const geometry::Vec7 step = chart_.coordinates(at_.evaluation.next) - from;
    Candidate candidate{at_.evaluation.next, evaluate_(at_.evaluation.next)};
    for (int k = 1; k <= rule_.halvings && !acceptable(candidate.evaluation); ++k) {
      candidate.T = chart_.similarity(from + std::ldexp(1.0, -k) * step);
      candidate.evaluation = evaluate_(candidate.T);
    }
    at_ = candidate;
  }

  const Evaluate& evaluate_;
  StepRule rule_;
  SimilarityChart chart_;
  Anderson anderson_;
  Candidate at_;
};

}  // namespace

FixedPointResult iterate(const Evaluate& evaluate, const Sim3& start, const StepRule& step, const StopRule& stop,
                         const PointSpread& points, double length_m) {
  Walk walk(evaluate, start, step, length_m);
  FixedPointResult result;
  std::optional<double> previous_rms_m;
  while (walk.at().evaluation.matched > 0) {
    const Evaluation& e = walk.at().evaluation;
    result.last_step_m = rms_motion_m(walk.at().T, e.next, points);
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
  result.T = walk.at().T;
  result.evaluation = walk.at().evaluation;
  return result;
}

}  // namespace tileflight::alignment
