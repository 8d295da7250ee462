#include "tileflight/evaluation/measured.h"

#include <algorithm>
#include <cmath>

#include "tileflight/evaluation/student_t.h"

namespace tileflight::evaluation {

using nlohmann::json;

namespace {

constexpr double kLevel = 0.05;

std::array<double, 2> exponential(const std::array<double, 2>& interval) {
  return {std::exp(interval[0]), std::exp(interval[1])};
}

bool usable(const Estimate& e) {
  return std::isfinite(e.value) && std::isfinite(e.standard_error) && e.degrees_of_freedom > 0.0;
}

/// Probability of at least this many standard errors above, zero of them as well.
double above(double distance, const Estimate& e) {
  if (e.standard_error == 0.0) return distance > 0.0 ? 0.0 : 1.0;
  return 1.0 - student_t_cdf(distance / e.standard_error, e.degrees_of_freedom);
}

/// Names of the measures that `wanted` says.
template <class Wanted>
std::vector<std::string> names_of(const std::vector<Measured>& measures, const Wanted& wanted) {
  std::vector<std::string> names;
  for (const Measured& m : measures) {
    if (m.decides && wanted(m)) names.push_back(m.name);
  }
  return names;
}

/// Holm, Scandinavian Journal of Statistics 6, 1979: from the smallest p on, as long as each is at most its share of
/// the level.
void find_different(std::vector<Measured*> together) {
  std::sort(together.begin(), together.end(),
            [](const Measured* a, const Measured* b) { return a->p_within < b->p_within; });
  double left = static_cast<double>(together.size());
  for (Measured* m : together) {
    if (!(m->p_within <= kLevel / left)) return;
    m->verdict = "different";
    left -= 1.0;
  }
}

}  // namespace

std::array<double, 2> Estimate::ci95() const {
  if (!usable(*this)) return {Measured::kNaN, Measured::kNaN};
  const double half = standard_error > 0.0 ? standard_error * student_t_quantile(0.975, degrees_of_freedom) : 0.0;
  return {value - half, value + half};
}

double Estimate::p_within(double margin) const {
  if (!usable(*this)) return Measured::kNaN;
  return std::min(1.0, 2.0 * above(std::abs(value) - margin, *this));
}

double Estimate::p_beyond(double margin) const {
  if (!usable(*this)) return Measured::kNaN;
  return std::max(above(margin - value, *this), above(margin + value, *this));
}

void judge(const Estimate& difference, const Estimate& log_ratio, Measured& m) {
  m.difference = difference.value;
  m.ratio = std::exp(log_ratio.value);
  m.difference_ci95 = difference.ci95();
  m.ratio_ci95 = exponential(log_ratio.ci95());
  const bool by_ratio = m.scale == Scale::kRatio;
  const Estimate& judged = by_ratio ? log_ratio : difference;
  const double margin = by_ratio ? std::log(m.margin) : m.margin;
  m.p_within = judged.p_within(margin);
  m.p_beyond = judged.p_beyond(margin);
  if (!(m.or_within > 0.0)) return;
  // Within the one or the other margin; beyond both.
  m.p_within = std::max(m.p_within, difference.p_within(m.or_within));
  m.p_beyond = std::min(m.p_beyond, difference.p_beyond(m.or_within));
}

Verdict verdict_on(std::vector<Measured>& measures) {
  std::vector<Measured*> together;
  for (Measured& m : measures) {
    m.verdict = m.p_beyond <= kLevel ? "equivalent" : "undecided";
    if (m.decides && std::isfinite(m.p_within)) {
      together.push_back(&m);
    } else {
      find_different({&m});
    }
  }
  find_different(std::move(together));
  const auto is = [](const char* word) { return [word](const Measured& m) { return m.verdict == word; }; };
  Verdict result{.on = names_of(measures, [](const Measured&) { return true; }),
                 .because = names_of(measures, is("different"))};
  if (!result.because.empty()) {
    result.word = "different";
    return result;
  }
  result.because = names_of(measures, is("undecided"));
  if (result.because.empty() && !result.on.empty()) result.word = "equivalent";
  return result;
}

json to_json(const Measured& m) {
  const bool by_ratio = m.scale == Scale::kRatio;
  return {{"simulated", m.simulated},
          {"real", m.real},
          {"difference", m.difference},
          {"ci95", m.difference_ci95},
          {"ratio", m.ratio},
          {"ratio_ci95", m.ratio_ci95},
          {"margin", m.margin},
          {"margin_of", by_ratio ? "ratio" : "difference"},
          {"or_within", m.or_within > 0.0 ? json(m.or_within) : json(nullptr)},
          {"decides", m.decides},
          {"p_within", m.p_within},
          {"p_beyond", m.p_beyond},
          {"unit", m.unit},
          {"verdict", m.verdict}};
}

}  // namespace tileflight::evaluation
