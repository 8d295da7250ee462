#include "tileflight/evaluation/metrics/compared_metric.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "tileflight/evaluation/metrics/student_t.h"

namespace tileflight::metrics {

namespace {

/// Interval at 1 - alpha of the expected error from the error of one path: chi-square with two degrees of freedom,
/// whose quantile is -2 ln(1 - q).
std::array<double, 2> interval_of(double error_m, double alpha) {
  return {error_m / std::sqrt(-std::log(0.5 * alpha)), error_m / std::sqrt(-std::log1p(-0.5 * alpha))};
}

/// Interval of the difference, by the method of variance estimates recovery (MOVER).
std::array<double, 2> difference_interval(double a_m, double b_m, double alpha) {
  const auto a = interval_of(a_m, alpha), b = interval_of(b_m, alpha);
  return {a_m - b_m - std::hypot(a_m - a[0], b[1] - b_m), a_m - b_m + std::hypot(a[1] - a_m, b_m - b[0])};
}

/// Largest alpha up to `most` at which `holds` is still false for the interval at 1 - alpha, which shrinks as alpha
/// grows; 0 if it is true for all.
template <class Holds>
double last_alpha_without(double most, const Holds& holds) {
  double low = 0.0, high = most;
  if (!holds(high)) return most;
  for (int halvings = 0; halvings < 60; ++halvings) {
    const double middle = 0.5 * (low + high);
    (holds(middle) ? high : low) = middle;
  }
  return low;
}

/// Above this alpha both ends of interval_of() are on the same side of the error.
constexpr double kMaxAlpha = 0.7;

double p_difference_within(double a_m, double b_m, double margin_m) {
  const double p = last_alpha_without(kMaxAlpha, [&](double alpha) {
    const auto interval = difference_interval(a_m, b_m, alpha);
    return interval[0] > margin_m || interval[1] < -margin_m;
  });
  return p < kMaxAlpha ? p : 1.0;
}

double p_difference_beyond(double a_m, double b_m, double margin_m) {
  const double alpha = last_alpha_without(kMaxAlpha, [&](double at) {
    const auto interval = difference_interval(a_m, b_m, at);
    return interval[0] > -margin_m && interval[1] < margin_m;
  });
  return alpha < kMaxAlpha ? 0.5 * alpha : 1.0;  // half for each of the two tests
}

/// Upper tail probability of F(2, 2).
double upper_tail(double x) { return 1.0 / (1.0 + x); }

}  // namespace

void judge_single_paths(double simulated_m, double real_m, ComparedMetric& m) {
  constexpr double kAlpha = 0.05;
  m.simulated = simulated_m;
  m.real = real_m;
  m.difference = simulated_m - real_m;
  m.sampling_unit = "one path";
  if (!(simulated_m > 0.0) || !(real_m > 0.0)) return;
  m.ratio = simulated_m / real_m;
  const double widest = std::sqrt((1.0 - 0.5 * kAlpha) / (0.5 * kAlpha));  // root of the F's quantile q / (1 - q)
  m.ratio_ci95 = {m.ratio / widest, m.ratio * widest};
  m.difference_ci95 = difference_interval(simulated_m, real_m, kAlpha);
  const double farther = std::max(m.ratio, 1.0 / m.ratio) / m.margin;
  const double p_ratio_within = std::min(1.0, 2.0 * upper_tail(farther * farther));
  const double p_ratio_beyond = upper_tail(1.0 / (farther * farther));
  m.p_within = std::max(p_ratio_within, p_difference_within(simulated_m, real_m, m.absolute_margin));
  m.p_beyond = std::min(p_ratio_beyond, p_difference_beyond(simulated_m, real_m, m.absolute_margin));
}

using nlohmann::json;

namespace {

constexpr double kLevel = 0.05;

std::array<double, 2> exponential(const std::array<double, 2>& interval) {
  return {std::exp(interval[0]), std::exp(interval[1])};
}

bool usable(const Estimate& e) {
  return std::isfinite(e.value) && std::isfinite(e.standard_error) && e.degrees_of_freedom > 0.0;
}

/// Upper tail probability of a distance; handles a standard error of zero.
double upper_tail(double distance, const Estimate& e) {
  if (e.standard_error == 0.0) return distance > 0.0 ? 0.0 : 1.0;
  return 1.0 - student_t_cdf(distance / e.standard_error, e.degrees_of_freedom);
}

/// Names of the metrics for which `wanted` is true.
template <class Wanted>
std::vector<std::string> names_of(const std::vector<ComparedMetric>& measures, const Wanted& wanted) {
  std::vector<std::string> names;
  for (const ComparedMetric& m : measures) {
    if (m.is_decisive && wanted(m)) names.push_back(m.name);
  }
  return names;
}

/// Holm, Scandinavian Journal of Statistics 6, 1979: from the smallest p-value on, as long as each is at most its share
/// of the level.
void apply_holm(std::vector<ComparedMetric*> together) {
  std::sort(together.begin(), together.end(),
            [](const ComparedMetric* a, const ComparedMetric* b) { return a->p_within < b->p_within; });
  double left = static_cast<double>(together.size());
  for (ComparedMetric* m : together) {
    if (!(m->p_within <= kLevel / left)) return;
    m->verdict = "different";
    left -= 1.0;
  }
}

}  // namespace

std::array<double, 2> Estimate::ci95() const {
  if (!usable(*this)) return {ComparedMetric::kNaN, ComparedMetric::kNaN};
  const double half = standard_error > 0.0 ? standard_error * student_t_quantile(0.975, degrees_of_freedom) : 0.0;
  return {value - half, value + half};
}

double Estimate::p_within(double margin) const {
  if (!usable(*this)) return ComparedMetric::kNaN;
  return std::min(1.0, 2.0 * upper_tail(std::abs(value) - margin, *this));
}

double Estimate::p_beyond(double margin) const {
  if (!usable(*this)) return ComparedMetric::kNaN;
  return std::max(upper_tail(margin - value, *this), upper_tail(margin + value, *this));
}

void judge_equivalence(const Estimate& difference, const Estimate& log_ratio, ComparedMetric& m) {
  m.difference = difference.value;
  m.ratio = std::exp(log_ratio.value);
  m.difference_ci95 = difference.ci95();
  m.ratio_ci95 = exponential(log_ratio.ci95());
  const bool by_ratio = m.scale == MarginScale::kRatio;
  const Estimate& judged = by_ratio ? log_ratio : difference;
  const double margin = by_ratio ? std::log(m.margin) : m.margin;
  m.p_within = judged.p_within(margin);
  m.p_beyond = judged.p_beyond(margin);
  if (!(m.absolute_margin > 0.0)) return;
  // Equivalent within either margin; different only beyond both.
  m.p_within = std::max(m.p_within, difference.p_within(m.absolute_margin));
  m.p_beyond = std::min(m.p_beyond, difference.p_beyond(m.absolute_margin));
}

Verdict decide_verdict(std::vector<ComparedMetric>& measures) {
  std::vector<ComparedMetric*> together;
  for (ComparedMetric& m : measures) {
    m.verdict = m.p_beyond <= kLevel ? "equivalent" : "undecided";
    if (m.is_decisive && std::isfinite(m.p_within)) {
      together.push_back(&m);
    } else {
      apply_holm({&m});
    }
  }
  apply_holm(std::move(together));
  const auto is = [](const char* word) { return [word](const ComparedMetric& m) { return m.verdict == word; }; };
  Verdict result{.decisive_metrics = names_of(measures, [](const ComparedMetric&) { return true; }),
                 .reasons = names_of(measures, is("different"))};
  if (!result.reasons.empty()) {
    result.word = "different";
    return result;
  }
  result.reasons = names_of(measures, is("undecided"));
  if (result.reasons.empty() && !result.decisive_metrics.empty()) result.word = "equivalent";
  return result;
}

json to_json(const ComparedMetric& m) {
  const bool by_ratio = m.scale == MarginScale::kRatio;
  return {{"simulated", m.simulated},
          {"real", m.real},
          {"difference", m.difference},
          {"ci95", m.difference_ci95},
          {"ratio", m.ratio},
          {"ratio_ci95", m.ratio_ci95},
          {"margin", m.margin},
          {"margin_of", by_ratio ? "ratio" : "difference"},
          {"or_within", m.absolute_margin > 0.0 ? json(m.absolute_margin) : json(nullptr)},
          {"decides", m.is_decisive},
          {"p_within", m.p_within},
          {"p_beyond", m.p_beyond},
          {"unit", m.sampling_unit},
          {"verdict", m.verdict}};
}

}  // namespace tileflight::metrics
