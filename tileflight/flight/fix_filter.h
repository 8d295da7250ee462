#pragma once

#include <cstddef>
#include <string>

#include "tileflight/flight/telemetry.h"

namespace tileflight::flight {

/// Takes a log's entries in their order and keeps those that say where and when: on the earth, not at 0, 0 (what
/// receivers write before their first fix), later than the one before. Counts the others.
class FixFilter {
 public:
  /// An entry whose time is not known.
  void drop_without_time() { ++without_time_; }
  /// An entry without a position.
  void drop_without_fix() { ++without_fix_; }
  /// An entry with a position.
  void add(const TelemetryFix& fix);

  /// What was kept, with one warning for each reason of dropping.
  Telemetry finish() &&;
  /// The same; throws InputError when nothing was kept. `where`: the file; `entries`: what its entries are ("rows").
  Telemetry finish(const std::string& where, const std::string& entries) &&;

 private:
  Telemetry telemetry_;
  std::size_t entries_ = 0, without_time_ = 0, without_fix_ = 0, off_the_earth_ = 0, out_of_order_ = 0;
};

/// Times, of the gyroscope too, become seconds from the first fix.
void count_from_first_fix(Telemetry& telemetry);

/// Whether a time in seconds is one since 1970 (later than September 2001) rather than of a clock that starts with the
/// log, the video or the vehicle.
bool is_date(double time_s);

/// Times that are dates count from the first fix; others stay.
void count_dates_from_first_fix(Telemetry& telemetry);

/// Where some fixes have a height and others have none at all, those without are dropped, with a warning.
void drop_fixes_without_height(Telemetry& telemetry);

}  // namespace tileflight::flight
