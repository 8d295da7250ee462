#include "tileflight/capture/render/image_formation_section.h"

#include <cmath>

#include "tileflight/core/base/text_parsing.h"

namespace tileflight::render {
namespace {

/// The section's presence enables it.
AutoExposure read_auto_exposure(base::StrictSection& section) {
  constexpr double kMiddleGrey = 0.18;
  AutoExposure a;
  a.target = section.positive_number("target").value_or(kMiddleGrey);
  a.time_constant_s = section.number("time_constant").value_or(a.time_constant_s);
  a.min_gain = section.positive_number("min_gain").value_or(a.min_gain);
  a.max_gain = section.positive_number("max_gain").value_or(a.max_gain);
  section.require_all_keys_used();
  return a;
}

/// `light: {model: baked | sun-and-sky, time, turbidity, ground_albedo, exposure, white_balance}`.
std::optional<DaylightOptions> read_light(base::StrictSection& section) {
  const bool is_baked = section.choice("model", {"baked", "sun-and-sky"}).value_or("sun-and-sky") == "baked";
  DaylightOptions light;
  if (const auto time = section.text("time")) {
    light.utc_s = base::parse_iso_time_s(*time);
    if (!light.utc_s) throw section.error("time", "must be a valid date and time such as 2024-03-20T17:00:00Z");
  }
  light.turbidity = section.number("turbidity").value_or(light.turbidity);
  light.ground_albedo = section.number("ground_albedo").value_or(light.ground_albedo);
  light.exposure_stops = section.number("exposure").value_or(light.exposure_stops);
  if (section.choice("white_balance", {"ground", "daylight"}).value_or("ground") == "daylight")
    light.white_balance = WhiteBalance::kDaylight;
  section.require_all_keys_used();
  return is_baked ? std::nullopt : std::optional(light);
}

/// `key: [red, green, blue]`, 0 to 255.
std::optional<imaging::Rgb8> read_color(base::StrictSection& section, const std::string& key) {
  const auto values = section.numbers(key, 3, 3);
  if (!values) return std::nullopt;
  imaging::Rgb8 color;
  for (std::size_t c = 0; c < 3; ++c) {
    if (!((*values)[c] >= 0.0 && (*values)[c] <= 255.0))
      throw section.error(key, "must be three numbers from 0 to 255");
    color[c] = static_cast<std::uint8_t>(std::lround((*values)[c]));
  }
  return color;
}

}  // namespace

ImageFormation read_image_formation(base::StrictSection& section, const ImageFormation& defaults) {
  ImageFormation f = defaults;
  const auto number = [&section](const std::string& key, double& value) {
    value = section.number(key).value_or(value);
  };
  if (auto light = section.section("light")) f.light = read_light(*light);
  number("haze_visibility", f.haze_visibility_m);
  if (const auto color = read_color(section, "haze_color")) f.haze_color = color;
  number("chromatic_red", f.chromatic_red);
  number("chromatic_blue", f.chromatic_blue);
  number("exposure_time", f.exposure_time_s);
  f.exposure_samples = section.integer("exposure_samples").value_or(f.exposure_samples);
  number("line_delay", f.line_delay_s);
  number("vignetting", f.vignetting);
  if (auto automatic = section.section("auto_exposure")) f.auto_exposure = read_auto_exposure(*automatic);
  number("exposure_drift", f.exposure_drift);
  number("exposure_drift_period", f.exposure_drift_period_s);
  if (section.has("exposure_steps")) f.exposure_steps.clear();
  for (base::StrictSection& step : section.sections("exposure_steps")) {
    f.exposure_steps.push_back({step.number("time").value_or(0.0), step.number("gain").value_or(1.0)});
    step.require_all_keys_used();
  }
  number("white_electrons", f.white_electrons);
  number("read_noise_electrons", f.read_noise_electrons);
  number("gamma", f.gamma);
  number("sharpening", f.sharpening);
  number("sharpening_radius", f.sharpening_radius_px);
  section.require_all_keys_used();
  validate_image_formation(f);
  return f;
}

}  // namespace tileflight::render
