#pragma once

#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "tileflight/data/flight_logs/telemetry.h"

namespace tileflight::flight_logs {

/// A log's messages of one kind: one row of numbers per message, NaN for missing ones.
using LogRows = std::vector<std::vector<double>>;

/// Rows by the name of their message or topic; none if it is absent.
const LogRows& find_rows(const std::map<std::string, LogRows>& rows, std::string_view name);

/// Sorts by the first number, the time, so that it strictly increases; rows without a time are dropped.
LogRows sort_by_time(LogRows rows);

/// The row nearest in time, at most `farthest` away, or nullptr. `rows` are sorted by sort_by_time; times are in the
/// unit of the rows.
const std::vector<double>* nearest_in_time(const LogRows& rows, double time, double farthest);

/// Converts rows of a time and three rates (about forward, right, down), sorted by time; rows with a missing number are
/// dropped. `time_unit_s` and `rate_unit_rad_s` are the units of the numbers.
std::vector<BodyRate> to_body_rates(const LogRows& rows, double time_unit_s, double rate_unit_rad_s = 1.0);

}  // namespace tileflight::flight_logs
