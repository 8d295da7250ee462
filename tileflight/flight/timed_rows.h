#pragma once

#include <vector>

#include "tileflight/flight/telemetry.h"

namespace tileflight::flight {

/// A log's messages of one kind, each a row of numbers, NaN for what is not there.
using LogRows = std::vector<std::vector<double>>;

/// By their first number, the time, which strictly increases; rows without a time are left out.
LogRows in_order_of_time(LogRows rows);

/// The row next in time, at most `farthest` away; nullptr where there is none. `rows` as in_order_of_time gives them;
/// times are in the rows' unit.
const std::vector<double>* next_in_time(const LogRows& rows, double time, double farthest);

/// Rows of a time and three rates (about forward, right, down), in order of time; those with a number missing are left
/// out. `time_unit_s`, `rate_unit_rad_s`: what the numbers count.
std::vector<BodyRate> body_rates_of(const LogRows& rows, double time_unit_s, double rate_unit_rad_s = 1.0);

}  // namespace tileflight::flight
