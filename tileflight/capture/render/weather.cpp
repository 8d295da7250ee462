#include "tileflight/capture/render/weather.h"

#include <cmath>
#include <numbers>

#include "tileflight/capture/render/precipitation.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/strict_section.h"

namespace tileflight::render {
namespace {

constexpr double kLeastVisibility_m = 1.0, kMostVisibility_m = 1e6;
constexpr double kMostRain_mm_per_h = 300.0, kMostSnow_mm_per_h = 30.0;
constexpr double kLeastScaleHeight_m = 1.0, kMostHeight_m = 1e5, kMostWind_m_s = 100.0;

bool is_within(double value, double least, double most) { return value >= least && value <= most; }

/// 0, for none, or a distance.
void require_visibility(double visibility_m, const char* what) {
  base::require(visibility_m == 0.0 || is_within(visibility_m, kLeastVisibility_m, kMostVisibility_m), what,
                "must lie between 1 and 1000000 m, or be 0 for none");
}

/// 0 without the key.
double read_if_given(base::StrictSection& section, const std::string& key, double least, double most) {
  const std::optional<double> value = section.number(key);
  return value ? section.number(key, *value, least, most) : 0.0;
}

double per_m_of_db_per_km(double db_per_km) { return db_per_km * std::numbers::ln10 / 10.0 * 1e-3; }

}  // namespace

void validate_weather(const WeatherOptions& w) {
  require_visibility(w.fog_visibility_m, "weather: fog's visibility");
  require_visibility(w.dust_visibility_m, "weather: dust's visibility");
  base::require(w.scale_height_m == 0.0 || is_within(w.scale_height_m, kLeastScaleHeight_m, kMostHeight_m),
                "weather: scale height", "must lie between 1 and 100000 m, or be 0 for none");
  base::require(is_within(w.base_height_m, -kMostHeight_m, kMostHeight_m), "weather: base height",
                "must lie between -100000 and 100000 m");
  base::require(is_within(w.rain_mm_per_h, 0.0, kMostRain_mm_per_h), "weather: rain",
                "must lie between 0 and 300 mm/h");
  base::require(is_within(w.snow_mm_per_h, 0.0, kMostSnow_mm_per_h), "weather: snow", "must lie between 0 and 30 mm/h");
  base::require(is_within(w.wetness, 0.0, 1.0), "weather: wetness", "must lie between 0 and 1");
  base::require(w.wind_m_s.norm() <= kMostWind_m_s, "weather: wind", "must be at most 100 m/s");
  base::require(is_within(w.streak_exposure_s, 1e-5, 1.0), "weather: streak exposure",
                "must lie between 0.00001 and 1 s");
}

std::optional<WeatherOptions> read_weather(base::StrictSection& flight) {
  std::optional<base::StrictSection> section = flight.section("weather");
  if (!section) return std::nullopt;
  WeatherOptions w;
  w.fog_visibility_m = read_if_given(*section, "fog_visibility_m", kLeastVisibility_m, kMostVisibility_m);
  w.dust_visibility_m = read_if_given(*section, "dust_visibility_m", kLeastVisibility_m, kMostVisibility_m);
  w.scale_height_m = read_if_given(*section, "scale_height_m", kLeastScaleHeight_m, kMostHeight_m);
  w.base_height_m = section->number("base_height_m", w.base_height_m, -kMostHeight_m, kMostHeight_m);
  w.rain_mm_per_h = section->number("rain_mm_per_h", w.rain_mm_per_h, 0.0, kMostRain_mm_per_h);
  w.snow_mm_per_h = section->number("snow_mm_per_h", w.snow_mm_per_h, 0.0, kMostSnow_mm_per_h);
  w.wetness = section->number("wetness", w.wetness, 0.0, 1.0);
  if (const auto wind = section->numbers("wind_m_s", 2, 2)) w.wind_m_s = {(*wind)[0], (*wind)[1], 0.0};
  if (w.wind_m_s.norm() > kMostWind_m_s) throw section->error("wind_m_s", "must be at most 100 m/s");
  w.streak_exposure_s = section->number("streak_exposure_s", w.streak_exposure_s, 1e-5, 1.0);
  section->require_all_keys_used();
  return w;
}

std::optional<WeatherOptions> read_weather(const std::filesystem::path& flight_file) {
  base::StrictSection flight = base::StrictSection::load(flight_file);
  return read_weather(flight);
}

std::string describe_weather(const WeatherOptions& w) {
  const WeatherOptions none;
  std::string text;
  const auto add = [&](const char* key, double value, double usual) {
    if (value == usual) return;
    text += (text.empty() ? "" : ", ") + std::string(key) + ": " + base::fixed_text(value);
  };
  add("fog_visibility_m", w.fog_visibility_m, none.fog_visibility_m);
  add("dust_visibility_m", w.dust_visibility_m, none.dust_visibility_m);
  add("scale_height_m", w.scale_height_m, none.scale_height_m);
  add("base_height_m", w.base_height_m, none.base_height_m);
  add("rain_mm_per_h", w.rain_mm_per_h, none.rain_mm_per_h);
  add("snow_mm_per_h", w.snow_mm_per_h, none.snow_mm_per_h);
  add("wetness", w.wetness, none.wetness);
  add("wind_east_m_s", w.wind_m_s.x(), 0.0);
  add("wind_north_m_s", w.wind_m_s.y(), 0.0);
  add("streak_exposure_s", w.streak_exposure_s, none.streak_exposure_s);
  return text.empty() ? "clear" : text;
}

double extinction_at_visibility(double visibility_m) {
  constexpr double kTwoPercent = 3.912;  // -ln 0.02
  return visibility_m > 0.0 ? kTwoPercent / visibility_m : 0.0;
}

/// 2 (pi / 4) times the integral of D^2 N0 exp(-L D), which is 2 N0 / L^3.
double rain_extinction_per_m(double rain_mm_per_h) {
  if (rain_mm_per_h <= 0.0) return 0.0;
  const SizeDistribution drops = marshall_palmer(rain_mm_per_h);
  constexpr double kSquareMetresOfSquareMillimetre = 1e-6;
  return std::numbers::pi * drops.per_m3_mm / std::pow(drops.slope_per_mm, 3) * kSquareMetresOfSquareMillimetre;
}

double snow_extinction_per_m(double snow_mm_per_h) {
  if (snow_mm_per_h <= 0.0) return 0.0;
  constexpr double kWavelength_nm = 550.0, kFactor = 5.42e-5 * kWavelength_nm + 5.4958776, kExponent = 1.38;
  return per_m_of_db_per_km(kFactor * std::pow(snow_mm_per_h, kExponent));
}

}  // namespace tileflight::render
