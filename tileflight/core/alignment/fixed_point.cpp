#include "tileflight/core/alignment/fixed_point.h"

#include <cmath>
#include <deque>
#include <optional>

#include "tileflight/core/geometry/decompositions.h"
#include "tileflight/core/geometry/transform.h"

namespace tileflight::alignment {

using geometry::Sim3;

namespace {

/// Anderson acceleration of a fixed-point iteration x <- g(x) in seven dimensions: combines the last steps so that the
/// norm of their combined residuals g(x) - x is minimal. Walker and Ni, SIAM J. Numerical Analysis 49(4), 2011 (their
/// method of differences); for ICP see Pavlov et al., ICRA 2018.
class AndersonAcceleration {
 public:
  /// The next x, given the present x and g = g(x).
  geometry::Vec7 next(const geometry::Vec7& x, const geometry::Vec7& g);

  /// Clears the history; call after a step was rejected.
  void reset();

 private:
  static constexpr std::size_t kWindow = 6;

  struct Entry {
    geometry::Vec7 g;
    geometry::Vec7 residual;
  };
  std::deque<Entry> history_;  ///< oldest first
};

using geometry::Vec7;

Vec7 AndersonAcceleration::next(const Vec7& x, const Vec7& g) {
  history_.push_back({g, g - x});
  if (history_.size() > kWindow + 1) history_.pop_front();
  const auto columns = static_cast<Eigen::Index>(history_.size()) - 1;
  if (columns == 0) return g;

  Eigen::Matrix<double, 7, Eigen::Dynamic> residual_steps(7, columns), g_steps(7, columns);
  for (Eigen::Index k = 0; k < columns; ++k) {
    const Entry& older = history_[static_cast<std::size_t>(k)];
    const Entry& newer = history_[static_cast<std::size_t>(k) + 1];
    residual_steps.col(k) = newer.residual - older.residual;
    g_steps.col(k) = newer.g - older.g;
  }
  const Eigen::VectorXd gamma = geometry::solve_with_least_norm(residual_steps, history_.back().residual);
  if (!gamma.allFinite()) return g;
  return g - g_steps * gamma;
}

void AndersonAcceleration::reset() { history_.clear(); }

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
