#include "tileflight/capture/events/event_options.h"

#include <array>

#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/strict_section.h"

namespace tileflight::events {
namespace {

/// An option with a number: its key, range, and what the range is.
struct NumberOption {
  const char* key;
  double EventOptions::*value;
  double least, most;
};

constexpr std::array<NumberOption, 11> kNumbers{{
    {"positive_threshold", &EventOptions::positive_threshold, kLeastThreshold, kMostThreshold},
    {"negative_threshold", &EventOptions::negative_threshold, kLeastThreshold, kMostThreshold},
    {"threshold_sigma", &EventOptions::threshold_sigma, 0.0, 1.0},
    {"dark_light", &EventOptions::dark_light, 1e-6, 1.0},
    {"refractory_s", &EventOptions::refractory_s, 0.0, 1.0},
    {"leak_rate_hz", &EventOptions::leak_rate_hz, 0.0, 1000.0},
    {"shot_noise_rate_hz", &EventOptions::shot_noise_rate_hz, 0.0, 1000.0},
    {"max_motion_px", &EventOptions::max_motion_px, 0.01, 10.0},
    {"max_change", &EventOptions::max_change, 0.0, 10.0},
    {"max_step_s", &EventOptions::max_step_s, 1e-5, 1.0},
    {"max_rate_hz", &EventOptions::max_rate_hz, 0.001, 1e6},
}};

}  // namespace

void validate_event_options(const EventOptions& options) {
  for (const NumberOption& number : kNumbers) {
    const double value = options.*number.value;
    if (!(value >= number.least && value <= number.most))
      throw InputError(std::string("events: ") + number.key,
                       "must lie between " + base::fixed_text(number.least) + " and " + base::fixed_text(number.most));
  }
}

std::optional<EventOptions> read_event_options(base::StrictSection& camera) {
  std::optional<base::StrictSection> section = camera.section("events");
  if (!section) return std::nullopt;
  EventOptions options;
  for (const NumberOption& number : kNumbers)
    options.*number.value = section->number(number.key, options.*number.value, number.least, number.most);
  section->require_all_keys_used();
  return options;
}

std::string describe_event_options(const EventOptions& options) {
  std::string text;
  for (const NumberOption& number : kNumbers)
    text += (text.empty() ? "" : ", ") + std::string(number.key) + ": " + base::fixed_text(options.*number.value);
  return text;
}

}  // namespace tileflight::events
