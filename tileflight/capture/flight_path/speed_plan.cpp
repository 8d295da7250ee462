#include "tileflight/capture/flight_path/speed_plan.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <deque>
#include <limits>

namespace tileflight::flight_path {
namespace {

/// Largest share of the acceleration limit used by the curve's curvature; the rest is for speeding up and braking.
constexpr double kBendShare = 0.7;

/// For each cell the largest value among the cells within `reach` of u.
std::vector<double> sliding_window_max(const std::vector<double>& u, const std::vector<double>& values, double reach) {
  std::vector<double> result(values.size());
  std::deque<std::size_t> candidates;  // indices whose values decrease
  std::size_t next = 0;
  for (std::size_t k = 0; k < values.size(); ++k) {
    for (; next < values.size() && u[next] <= u[k + 1] + reach; ++next) {
      while (!candidates.empty() && values[candidates.back()] <= values[next]) candidates.pop_back();
      candidates.push_back(next);
    }
    while (u[candidates.front() + 1] < u[k] - reach) candidates.pop_front();
    result[k] = values[candidates.front()];
  }
  return result;
}

/// Largest squared rate in a cell.
double squared_rate_limit(double first_m, double second_m, double rotation_rad, double speed_m_s,
                          const MotionLimits& limits) {
  const double by_speed = std::pow(speed_m_s / first_m, 2);
  const double by_bend = second_m > 0 ? kBendShare * limits.acceleration_m_s2 / second_m : by_speed;
  const double by_turn = rotation_rad > 0 ? std::pow(limits.rotation_rad_s / rotation_rad, 2) : by_speed;
  return std::min({by_speed, by_bend, by_turn});
}

/// Squared rate at each u of the grid, from rest to rest.
std::vector<double> plan_squared_rates(const CurveBounds& bounds, const MotionLimits& limits) {
  const std::size_t cells = bounds.first_m.size();
  std::vector<double> squared(cells + 1, std::numeric_limits<double>::infinity());
  std::vector<double> gain(cells);  // largest change of the squared rate over the cell: d(rate^2) = 2 u_tt du
  for (std::size_t k = 0; k < cells; ++k) {
    const double limit =
        squared_rate_limit(bounds.first_m[k], bounds.second_m[k], bounds.rotation_rad[k], bounds.speed_m_s[k], limits);
    squared[k] = std::min(squared[k], limit);
    squared[k + 1] = std::min(squared[k + 1], limit);
    gain[k] = 2.0 * (bounds.u[k + 1] - bounds.u[k]) * (limits.acceleration_m_s2 - bounds.second_m[k] * limit) /
              bounds.first_m[k];
  }
  squared.front() = squared.back() = 0.0;
  for (const Rest& rest : bounds.rests) squared[rest.node] = 0.0;
  for (std::size_t k = 0; k < cells; ++k) squared[k + 1] = std::min(squared[k + 1], squared[k] + gain[k]);
  for (std::size_t k = cells; k-- > 0;) squared[k] = std::min(squared[k], squared[k + 1] + gain[k]);
  return squared;
}

/// Limits |r'| from below by a thousandth of its maximum: where a curve reverses, |r'| = 0 would allow any rate.
CurveBounds clamp_first_derivative(CurveBounds bounds) {
  const double floor = 1e-3 * *std::max_element(bounds.first_m.begin(), bounds.first_m.end());
  for (double& value : bounds.first_m) value = std::max(value, floor);
  return bounds;
}

/// For each cell the smallest value among the cells within `reach` of u.
std::vector<double> sliding_window_min(const std::vector<double>& u, std::vector<double> values, double reach) {
  for (double& value : values) value = -value;
  values = sliding_window_max(u, values, reach);
  for (double& value : values) value = -value;
  return values;
}

CurveBounds dilate_bounds(const CurveBounds& bounds, double reach) {
  return {bounds.u,
          sliding_window_max(bounds.u, bounds.first_m, reach),
          sliding_window_max(bounds.u, bounds.second_m, reach),
          sliding_window_max(bounds.u, bounds.rotation_rad, reach),
          sliding_window_min(bounds.u, bounds.speed_m_s, reach),
          bounds.rests};
}

/// States a speed for each cell where the bounds state none.
CurveBounds with_speeds(CurveBounds bounds, double speed_m_s) {
  if (bounds.speed_m_s.empty()) bounds.speed_m_s.assign(bounds.first_m.size(), speed_m_s);
  return bounds;
}

}  // namespace

SpeedPlan::SpeedPlan(const CurveBounds& bounds, const MotionLimits& limits, double smoothing_s)
    : smoothing_s_(smoothing_s) {
  assert(bounds.u.size() >= 2 && bounds.first_m.size() + 1 == bounds.u.size());
  const CurveBounds floored = clamp_first_derivative(with_speeds(bounds, limits.speed_m_s));
  const std::vector<double> unaveraged = plan_squared_rates(floored, limits);
  const double reach = smoothing_s * std::sqrt(*std::max_element(unaveraged.begin(), unaveraged.end()));
  const std::vector<double> squared = plan_squared_rates(dilate_bounds(floored, reach), limits);
  nodes_.push_back({0.0, bounds.u[0], 0.0, 0.0});
  auto rest = bounds.rests.begin();
  // The average over the window is at rest for as long as asked if the plan rests longer by the window.
  const auto wait_at = [&](std::size_t k) {
    for (; rest != bounds.rests.end() && rest->node == k; ++rest) {
      const double wait_s = rest->seconds + smoothing_s;
      if (!(wait_s > 0.0)) continue;
      const Node& last = nodes_.back();
      nodes_.push_back({last.time_s + wait_s, last.u, 0.0, last.integral + wait_s * last.u});
    }
  };
  wait_at(0);
  for (std::size_t k = 1; k < squared.size(); ++k) {
    const Node& last = nodes_.back();
    const double rate = std::sqrt(squared[k]);
    const double step_s = 2.0 * (bounds.u[k] - last.u) / (last.rate + rate);
    const double acceleration = (rate - last.rate) / step_s;
    const double area = step_s * (last.u + step_s * (last.rate / 2.0 + step_s * acceleration / 6.0));
    nodes_.push_back({last.time_s + step_s, bounds.u[k], rate, last.integral + area});
    wait_at(k);
  }
}

double SpeedPlan::duration_s() const { return nodes_.back().time_s + smoothing_s_; }

SpeedPlan::Segment SpeedPlan::segment_at(double time_s) const {
  const auto above = std::upper_bound(nodes_.begin() + 1, nodes_.end() - 1, time_s,
                                      [](double time, const Node& node) { return time < node.time_s; });
  const Node &a = above[-1], &b = above[0];
  return {a, (b.rate - a.rate) / (b.time_s - a.time_s)};
}

Progression SpeedPlan::at_unsmoothed(double time_s) const {
  if (time_s <= 0.0) return {nodes_.front().u, 0.0, 0.0};
  if (time_s >= nodes_.back().time_s) return {nodes_.back().u, 0.0, 0.0};
  const auto [a, acceleration] = segment_at(time_s);
  const double t = time_s - a.time_s;
  return {a.u + t * (a.rate + t * acceleration / 2.0), a.rate + t * acceleration, acceleration};
}

double SpeedPlan::integral(double time_s) const {
  if (time_s <= 0.0) return nodes_.front().u * time_s;
  if (time_s >= nodes_.back().time_s) return nodes_.back().integral + nodes_.back().u * (time_s - nodes_.back().time_s);
  const auto [a, acceleration] = segment_at(time_s);
  const double t = time_s - a.time_s;
  return a.integral + t * (a.u + t * (a.rate / 2.0 + t * acceleration / 6.0));
}

Progression SpeedPlan::at(double time_s) const {
  const double end = std::clamp(time_s, 0.0, duration_s()), begin = end - smoothing_s_;
  const Progression a = at_unsmoothed(begin), b = at_unsmoothed(end);
  return {(integral(end) - integral(begin)) / smoothing_s_, (b.u - a.u) / smoothing_s_,
          (b.rate - a.rate) / smoothing_s_};
}

}  // namespace tileflight::flight_path
