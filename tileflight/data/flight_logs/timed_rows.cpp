#include "tileflight/data/flight_logs/timed_rows.h"

#include <algorithm>
#include <cmath>

namespace tileflight::flight_logs {

const LogRows& find_rows(const std::map<std::string, LogRows>& rows, std::string_view name) {
  static const LogRows kNone;
  const auto found = rows.find(std::string(name));
  return found == rows.end() ? kNone : found->second;
}

LogRows sort_by_time(LogRows rows) {
  std::erase_if(rows, [](const std::vector<double>& row) { return !std::isfinite(row[0]); });
  const auto earlier = [](const std::vector<double>& a, const std::vector<double>& b) { return a[0] < b[0]; };
  std::stable_sort(rows.begin(), rows.end(), earlier);
  const auto at_one_time = [](const std::vector<double>& a, const std::vector<double>& b) { return a[0] == b[0]; };
  rows.erase(std::unique(rows.begin(), rows.end(), at_one_time), rows.end());
  return rows;
}

const std::vector<double>* nearest_in_time(const LogRows& rows, double time, double farthest) {
  const auto later = std::lower_bound(rows.begin(), rows.end(), time,
                                      [](const std::vector<double>& row, double t) { return row[0] < t; });
  const std::vector<double>* nearest = nullptr;
  if (later != rows.end()) nearest = &*later;
  if (later != rows.begin() && (nearest == nullptr || time - (later - 1)->front() < nearest->front() - time)) {
    nearest = &*(later - 1);
  }
  return nearest != nullptr && std::abs(nearest->front() - time) <= farthest ? nearest : nullptr;
}

std::vector<BodyRate> to_body_rates(const LogRows& rows, double time_unit_s, double rate_unit_rad_s) {
  std::vector<BodyRate> rates;
  for (const std::vector<double>& row : sort_by_time(rows)) {
    const geometry::Vec3 rate(row[1], row[2], row[3]);
    if (rate.allFinite()) rates.push_back({time_unit_s * row[0], rate_unit_rad_s * rate});
  }
  return rates;
}

}  // namespace tileflight::flight_logs
