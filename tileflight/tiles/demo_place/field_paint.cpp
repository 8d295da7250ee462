#include <array>
#include <cmath>
#include <string_view>

#include "tileflight/core/base/noise.h"
#include "tileflight/tiles/demo_place/ground_paint.h"
#include "tileflight/tiles/demo_place/lettering.h"

namespace tileflight::demo_place {
namespace {

constexpr double kLine_m = 0.1016;  ///< 4 inches (NCAA rule 1-2-1)

/// Coverage of a line of width `width_m` centred at `distance_m` = 0.
float stroke(double distance_m, double width_m = kLine_m) { return edge_coverage(std::fabs(distance_m) - width_m / 2); }

/// Lines across the field: goal lines, a line every 5 yards, hash marks every yard (20 yards from the sidelines, and at
/// the sidelines).
float field_lines(double x, double y) {
  const double ax = std::fabs(x), ay = std::fabs(y);
  if (ax > kSideline_m + 1.9 || ay > kEndLine_m + 1.9) return 0.0F;
  const double outside = std::max(ax - kSideline_m, ay - kEndLine_m);
  float ink = edge_coverage(std::fabs(outside - 0.9) - 0.9);  // the border, 6 feet wide
  if (outside > 0) return ink;
  if (ay < kGoalLine_m + 0.1) ink = std::max(ink, band_coverage(y, 5 * kYard_m, kLine_m));
  ink = std::max(ink, stroke(ay - kGoalLine_m, 2 * kLine_m));
  if (ay < kGoalLine_m) {
    const double from_hash = std::fabs(ax - 6.1), from_side = kSideline_m - ax;
    const bool dash = from_hash < 0.33 || (from_side > 0.1 && from_side < 0.75);
    if (dash) ink = std::max(ink, band_coverage(y, kYard_m, kLine_m));
  }
  return ink;
}

/// Yard numbers, 6 feet high, tops 9 yards from the sideline, readable from that side.
bool on_number(double x, double y) {
  static constexpr std::array<std::string_view, 6> kNumbers{"0", "10", "20", "30", "40", "50"};
  const double ten = 10 * kYard_m * std::nearbyint(y / (10 * kYard_m));
  const auto tens = static_cast<int>(5.5 - std::fabs(ten) / (10 * kYard_m));
  if (tens < 1 || tens > 5) return false;
  constexpr double kUnit_m = 1.83 / 7;
  const double side = x < 0 ? -1.0 : 1.0;
  const double up = (kSideline_m - 9 * kYard_m + 1.83 - std::fabs(x)) / kUnit_m;
  const double half = text_width(kNumbers[static_cast<std::size_t>(tens)]) / 2;
  return is_ink(kNumbers[static_cast<std::size_t>(tens)], side * (y - ten) / kUnit_m + half, up);
}

/// Letters of the end zone, readable from the opposite half of the field.
bool on_end_zone_letters(double x, double y) {
  const std::string_view text = y > 0 ? "TILEFLIGHT" : "FOOTHILLS";
  constexpr double kUnit_m = 0.78;
  const double side = y > 0 ? 1.0 : -1.0;
  const double up = (std::fabs(y) - kGoalLine_m - 1.9) / kUnit_m;
  return is_ink(text, side * x / kUnit_m + text_width(text) / 2, up);
}

/// A ring and a row of chevrons in the middle of the field.
float emblem(double x, double y) {
  const double r = std::hypot(x, y);
  float ink = stroke(r - 5.6, 0.5);
  for (double offset = -2.4; offset < 3.0; offset += 2.4)
    if (r < 4.8) ink = std::max(ink, stroke(y + offset - 0.7 * std::fabs(x), 0.8));
  return ink;
}

Color apron_color(double x, double y, std::uint32_t seed) {
  const Color base = material::asphalt(x, y, seed + 9);
  const float joint = std::max(band_coverage(x, 6.0, 0.06), band_coverage(y, 6.0, 0.06));
  return mix_colors(Color(base * Color(1.18F, 0.82F, 0.66F)), {0.25F, 0.2F, 0.18F}, 0.4F * joint);
}

}  // namespace

Color field_color(double x, double y, std::uint32_t seed) {
  if (kTurfArea.distance(x, y) > 0) return apron_color(x, y, seed);
  Color color = material::turf(x, y, seed);
  const bool end_zone = std::fabs(y) > kGoalLine_m && std::fabs(y) < kEndLine_m && std::fabs(x) < kSideline_m;
  if (end_zone) color = mix_colors(color, Color(0.10F, 0.30F, 0.20F) * (0.6F + 1.4F * color[1]), 0.75F);
  const Color chalk = Color(0.92F, 0.92F, 0.89F) * (0.75F + 0.55F * color[1]);
  float ink = std::max(field_lines(x, y), emblem(x, y));
  if (on_number(x, y) || (end_zone && on_end_zone_letters(x, y))) ink = 1.0F;
  if (ink <= 0.0F) return color;
  const float wear = 0.82F + 0.3F * base::fractal_noise(x / 0.9, y / 0.9, seed + 8, 4, 0.6F);
  return mix_colors(color, chalk, ink * std::clamp(wear, 0.35F, 0.97F));
}

}  // namespace tileflight::demo_place
