#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "tileflight/data/flight_logs/telemetry.h"

namespace tileflight::flight_logs {

/// Collects a log's entries in order and keeps those with a valid time and position: coordinates on the earth, not 0, 0
/// (which receivers write before their first fix), and later than the entry before. Counts the others.
class FixFilter {
 public:
  /// Drops an entry whose time is unknown.
  void drop_without_time() { ++without_time_; }
  /// Drops an entry without a position.
  void drop_without_fix() { ++without_fix_; }
  /// Adds an entry with a position.
  void add(const TelemetryFix& fix);

  /// Returns the kept fixes, with one warning per reason for dropping entries.
  Telemetry finish() &&;
  /// Finishes as finish(), but throws InputError if no fix was kept, or only the first because no other is later.
  /// `where`: the file; `entries`: its entries' name ("rows"); `damage`: what the reader could not read of the file,
  /// which the error names as the cause.
  Telemetry finish(const std::string& where, const std::string& entries,
                   const std::vector<std::string>& damage = {}) &&;

 private:
  Telemetry telemetry_;
  std::size_t entries_ = 0, without_time_ = 0, without_fix_ = 0, off_the_earth_ = 0, out_of_order_ = 0;
};

/// Makes all times, including the gyroscope's, seconds from the first fix.
void rebase_to_first_fix(Telemetry& telemetry);

/// Whether a time in seconds is a Unix time (later than September 2001) rather than one of a clock that starts with the
/// log, the video or the vehicle.
bool is_unix_time(double time_s);

/// Makes Unix times seconds from the first fix; other times are unchanged.
void rebase_unix_times(Telemetry& telemetry);

/// Resets the absolute heights, with a warning, if all are exactly 0: then none was recorded.
void drop_unrecorded_heights(Telemetry& telemetry);

/// If only some fixes have a height, drops those without any, with a warning; as drop_unrecorded_heights() before.
void drop_fixes_without_height(Telemetry& telemetry);

/// The last steps for a log of UTC times and heights above sea level (GPX, KML).
void finish_utc_log(Telemetry& telemetry);

}  // namespace tileflight::flight_logs
