#include "tileflight/evaluation/metrics/repeated_runs.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "tileflight/evaluation/metrics/student_t.h"

namespace tileflight::metrics {

namespace {

std::array<double, 2> symmetric_interval(double middle, double half_width) {
  return {middle - half_width, middle + half_width};
}

double mean_of(const std::vector<double>& values) {
  double sum = 0.0;
  for (const double v : values) sum += v;
  return sum / static_cast<double>(values.size());
}

/// Standard deviation with divisor n - 1; exactly zero if all values are equal, regardless of rounding in the mean.
double deviation_of(const std::vector<double>& values, double mean) {
  const auto [least, most] = std::ranges::minmax(values);
  if (least == most) return 0.0;
  double squares = 0.0;
  for (const double v : values) squares += (v - mean) * (v - mean);
  return std::sqrt(squares / static_cast<double>(values.size() - 1));
}

/// Squared standard error of the mean.
double error_squared(const RunSpread& spread) { return spread.std * spread.std / static_cast<double>(spread.runs); }

double welch_degrees(const RunSpread& a, const RunSpread& b) {
  const double ea = error_squared(a), eb = error_squared(b);
  return (ea + eb) * (ea + eb) /
         (ea * ea / static_cast<double>(a.runs - 1) + eb * eb / static_cast<double>(b.runs - 1));
}

}  // namespace

RunSpread compute_run_spread(const std::vector<double>& values) {
  std::vector<double> known;
  std::ranges::copy_if(values, std::back_inserter(known), [](double v) { return std::isfinite(v); });
  RunSpread spread;
  spread.runs = known.size();
  if (known.empty()) return spread;
  spread.mean = mean_of(known);
  spread.min = std::ranges::min(known);
  spread.max = std::ranges::max(known);
  if (known.size() < 2) return spread;
  spread.std = deviation_of(known, spread.mean);
  if (spread.std > 0.0) {
    const double t = student_t_quantile(0.975, static_cast<double>(spread.runs - 1));
    spread.ci95 = symmetric_interval(spread.mean, t * std::sqrt(error_squared(spread)));
  }
  return spread;
}

bool RunDifference::has_interval() const { return std::isfinite(ci95[0]) && std::isfinite(ci95[1]); }

RunDifference welch_difference(const std::vector<double>& a, const std::vector<double>& b) {
  RunDifference result{.a = compute_run_spread(a), .b = compute_run_spread(b)};
  result.difference = result.a.mean - result.b.mean;
  const double error = std::sqrt(error_squared(result.a) + error_squared(result.b));
  if (result.a.runs < 2 || result.b.runs < 2 || !(error > 0.0)) return result;
  result.degrees_of_freedom = welch_degrees(result.a, result.b);
  result.ci95 = symmetric_interval(result.difference, error * student_t_quantile(0.975, result.degrees_of_freedom));
  result.ci90 = symmetric_interval(result.difference, error * student_t_quantile(0.95, result.degrees_of_freedom));
  return result;
}

nlohmann::json compute_json_spread(const std::vector<nlohmann::json>& objects) {
  using nlohmann::json;
  json tree = json::object();
  if (objects.empty() || !objects.front().is_object()) return tree;
  for (const auto& [key, first] : objects.front().items()) {
    std::vector<json> values;
    for (const json& object : objects) values.push_back(object.is_object() ? object.value(key, json()) : json());
    if (first.is_object()) {
      if (json below = compute_json_spread(values); !below.empty()) tree[key] = std::move(below);
    } else if (first.is_number()) {
      std::vector<double> numbers;
      for (const json& value : values) {
        if (value.is_number()) numbers.push_back(value.get<double>());
      }
      tree[key] = to_json(compute_run_spread(numbers));
    }
  }
  return tree;
}

nlohmann::json to_json(const RunSpread& spread) {
  return {{"n", spread.runs},  {"mean", spread.mean}, {"std", spread.std},
          {"min", spread.min}, {"max", spread.max},   {"ci95", spread.ci95}};
}

}  // namespace tileflight::metrics
