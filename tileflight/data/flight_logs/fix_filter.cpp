#include "tileflight/data/flight_logs/fix_filter.h"

#include <algorithm>
#include <cmath>

#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"

namespace tileflight::flight_logs {
namespace {

bool is_on_earth(const TelemetryFix& fix) {
  return std::abs(fix.latitude_deg) <= 90.0 && std::abs(fix.longitude_deg) <= 180.0;
}
bool is_null_island(const TelemetryFix& fix) { return fix.latitude_deg == 0.0 && fix.longitude_deg == 0.0; }

void warn_of(Telemetry& telemetry, std::size_t count, const std::string& reason) {
  if (count > 0) telemetry.warnings.push_back(std::to_string(count) + " entries dropped: " + reason);
}

}  // namespace

void FixFilter::add(const TelemetryFix& fix) {
  if (is_null_island(fix)) {
    ++without_fix_;
    return;
  }
  ++entries_;
  if (!is_on_earth(fix)) {
    ++off_the_earth_;
  } else if (!telemetry_.fixes.empty() && fix.time_s <= telemetry_.fixes.back().time_s) {
    ++out_of_order_;
  } else {
    telemetry_.fixes.push_back(fix);
  }
}

Telemetry FixFilter::finish() && {
  warn_of(telemetry_, without_time_, "no time");
  warn_of(telemetry_, without_fix_, "no position fix");
  warn_of(telemetry_, off_the_earth_, "latitude or longitude out of range");
  warn_of(telemetry_, out_of_order_, "time does not increase");
  return std::move(telemetry_);
}

Telemetry FixFilter::finish(const std::string& where, const std::string& entries,
                            const std::vector<std::string>& damage) && {
  constexpr std::size_t kSeveral = 3;
  const std::size_t count = entries_ + without_time_ + without_fix_, not_later = out_of_order_;
  Telemetry telemetry = std::move(*this).finish();
  if (telemetry.fixes.size() == 1 && not_later >= kSeveral)
    throw InputError(where, "none of its " + std::to_string(count) + " " + entries +
                                " is later than the first: export the log with the time of each");
  if (!telemetry.fixes.empty()) return telemetry;
  if (count == 0 && damage.empty()) throw InputError(where, "contains no " + entries);
  if (count == 0) {
    throw InputError(where, "contains no " + entries + " that can be read (" + base::joined(damage, "; ") +
                                "); copy or export the log again");
  }
  base::add_distinct(damage, telemetry.warnings);
  throw InputError(where, "none of its " + std::to_string(count) + " " + entries + " has a time and a position (" +
                              base::joined(telemetry.warnings, "; ") + "); export the log with both");
}

void rebase_to_first_fix(Telemetry& telemetry) {
  if (telemetry.fixes.empty()) return;
  const double first_s = telemetry.fixes.front().time_s;
  for (TelemetryFix& fix : telemetry.fixes) fix.time_s -= first_s;
  for (BodyRate& rate : telemetry.body_rates) rate.time_s -= first_s;
}

bool is_unix_time(double time_s) { return time_s >= 1e9; }

void rebase_unix_times(Telemetry& telemetry) {
  if (!telemetry.fixes.empty() && is_unix_time(telemetry.fixes.front().time_s)) rebase_to_first_fix(telemetry);
}

void drop_unrecorded_heights(Telemetry& telemetry) {
  constexpr std::size_t kSeveral = 2;
  const auto is_zero = [](const TelemetryFix& fix) { return fix.absolute_height_m == 0.0; };
  if (telemetry.fixes.size() < kSeveral || !std::ranges::all_of(telemetry.fixes, is_zero)) return;
  for (TelemetryFix& fix : telemetry.fixes) fix.absolute_height_m.reset();
  telemetry.warnings.push_back("the absolute height is 0 in every entry and is treated as not recorded");
}

void drop_fixes_without_height(Telemetry& telemetry) {
  drop_unrecorded_heights(telemetry);
  const auto has_none = [](const TelemetryFix& fix) { return !fix.absolute_height_m && !fix.height_above_takeoff_m; };
  if (std::all_of(telemetry.fixes.begin(), telemetry.fixes.end(), has_none)) return;
  const std::size_t before = telemetry.fixes.size();
  std::erase_if(telemetry.fixes, has_none);
  warn_of(telemetry, before - telemetry.fixes.size(), "no height");
}

void finish_utc_log(Telemetry& telemetry) {
  telemetry.zero_utc_s = telemetry.fixes.front().time_s;
  rebase_to_first_fix(telemetry);
  drop_fixes_without_height(telemetry);
  telemetry.height_datum = HeightDatum::kMeanSeaLevel;
}

}  // namespace tileflight::flight_logs
