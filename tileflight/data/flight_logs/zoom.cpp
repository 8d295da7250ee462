#include <cmath>

#include "tileflight/core/base/formatted_text.h"
#include "tileflight/data/flight_logs/telemetry.h"

namespace tileflight::flight_logs {
namespace {

/// One of a reading's numbers, with its name for messages and the share by which it differs where nothing changes.
struct ZoomMeasure {
  std::optional<double> ZoomReading::*value;
  const char* name;
  double tolerance;
};

struct ZoomChange {
  const ZoomReading* before = nullptr;  ///< the last reading before the first change
  const ZoomReading* last = nullptr;    ///< the reading after the last change
  double from = 0.0;                    ///< the first value
  double to = 0.0;                      ///< the value that differs most from it
};

std::optional<ZoomChange> find_change(const std::vector<ZoomReading>& readings, const ZoomMeasure& measure) {
  const ZoomReading* before = nullptr;
  ZoomChange change;
  for (const ZoomReading& reading : readings) {
    const std::optional<double>& value = reading.*measure.value;
    if (!value || *value <= 0.0) continue;
    if (before != nullptr && *value != *(before->*measure.value)) {
      if (change.before == nullptr) change.before = before;
      change.last = &reading;
    }
    if (before == nullptr) change.from = change.to = *value;
    if (std::abs(std::log(*value / change.from)) > std::abs(std::log(change.to / change.from))) change.to = *value;
    before = &reading;
  }
  if (change.before == nullptr || std::abs(std::log(change.to / change.from)) < measure.tolerance) return std::nullopt;
  return change;
}

std::string number_text(double value) { return base::formatted("%.3g", value); }

}  // namespace

std::vector<std::string> find_zoom_warnings(const std::vector<ZoomReading>& readings, const std::string& source) {
  constexpr double kRounded = 0.05;  // a focal length in whole millimetres, of 24 mm
  constexpr double kExact = 0.01;
  constexpr ZoomMeasure kMeasures[] = {{&ZoomReading::focal_length, "focal length", kExact},
                                       {&ZoomReading::digital_zoom, "digital zoom", kExact},
                                       {&ZoomReading::focal_length_35mm, "focal length in 35 mm film", kRounded}};
  for (const ZoomMeasure& measure : kMeasures) {
    const auto change = find_change(readings, measure);
    if (!change) continue;
    return {"the " + std::string(measure.name) + " changes by a factor of " + number_text(change->to / change->from) +
            " (" + number_text(change->from) + " to " + number_text(change->to) + ") between " + change->before->where +
            " and " + change->last->where + ", as " + source +
            " say: a calibration holds for one focal length; use the part before or after the zoom (--from, --to), or "
            "film without zoom"};
  }
  for (const ZoomReading& reading : readings) {
    if (!reading.digital_zoom || *reading.digital_zoom <= 1.0 + kExact) continue;
    return {"a digital zoom of " + number_text(*reading.digital_zoom) + " was set, as " + source +
            " say: use a calibration that was made with the same zoom; one without zoom has focal lengths that are too "
            "short by this factor"};
  }
  return {};
}

}  // namespace tileflight::flight_logs
