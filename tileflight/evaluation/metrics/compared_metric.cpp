#include "tileflight/evaluation/metrics/compared_metric.h"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>

#include "tileflight/evaluation/metrics/student_t.h"

namespace tileflight::metrics {

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
