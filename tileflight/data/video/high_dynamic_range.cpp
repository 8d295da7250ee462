#include "tileflight/data/video/high_dynamic_range.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace tileflight::video {

namespace {

constexpr std::size_t kValues = 65536;
constexpr double kWhite = 65280.0;               // to which libswscale maps white of 16 bits: 255 * 256
constexpr double kReferenceWhite_cd_m2 = 203.0;  // Report ITU-R BT.2408, table 1
constexpr double kHlgPeak_cd_m2 = 1000.0;        // nominal, for which the system gamma is 1.2

/// Light of a PQ value, cd/m2 (BT.2100, table 4).
double pq_light_cd_m2(double value) {
  constexpr double m1 = 2610.0 / 16384, m2 = 2523.0 / 4096 * 128, c1 = 3424.0 / 4096, c2 = 2413.0 / 4096 * 32,
                   c3 = 2392.0 / 4096 * 32;
  const double root = std::pow(value, 1.0 / m2);
  return 10000.0 * std::pow(std::max(root - c1, 0.0) / (c2 - c3 * root), 1.0 / m1);
}

/// Light of the scene of an HLG value, 0 to 1 (BT.2100, table 5).
double hlg_scene_light(double value) {
  constexpr double a = 0.17883277, b = 1.0 - 4.0 * a;
  const double c = 0.5 - a * std::log(4.0 * a);
  return value <= 0.5 ? value * value / 3.0 : (std::exp((value - c) / a) + b) / 12.0;
}

/// Keeps light up to 80 % of the reference white, and compresses what is above to at most 1.
float compressed(float light) {
  constexpr float kKnee = 0.8F;
  if (light <= kKnee) return std::max(light, 0.0F);
  return kKnee + (1.0F - kKnee) * static_cast<float>(1.0 - std::exp(-(light - kKnee) / (1.0 - kKnee)));
}

/// IEC 61966-2-1.
double srgb_value(double light) {
  return light <= 0.0031308 ? 12.92 * light : 1.055 * std::pow(light, 1.0 / 2.4) - 0.055;
}

}  // namespace

HighDynamicRange::HighDynamicRange(AVColorTransferCharacteristic transfer, AVColorPrimaries primaries)
    : transfer_(transfer), primaries_(primaries), light_(kValues), level_(kValues) {
  const bool is_hlg = transfer == AVCOL_TRC_ARIB_STD_B67;
  for (std::size_t i = 0; i < kValues; ++i) {
    const double value = std::min(static_cast<double>(i) / kWhite, 1.0);
    light_[i] = static_cast<float>(is_hlg ? hlg_scene_light(value) : pq_light_cd_m2(value) / kReferenceWhite_cd_m2);
    level_[i] = static_cast<std::uint8_t>(std::lround(255.0 * srgb_value(static_cast<double>(i) / (kValues - 1))));
  }
  if (!is_hlg) return;
  system_gain_.resize(kValues);
  for (std::size_t i = 0; i < kValues; ++i)
    system_gain_[i] = static_cast<float>(kHlgPeak_cd_m2 / kReferenceWhite_cd_m2 *
                                         std::pow(static_cast<double>(i) / (kValues - 1), 0.2));
}

void HighDynamicRange::map(std::span<const std::uint16_t> encoded, std::span<imaging::Rgb8> shown) const {
  // Linear BT.2020 to BT.709 (Report ITU-R BT.2407, section 2).
  constexpr std::array<std::array<float, 3>, 3> kTo709{
      {{1.6605F, -0.5876F, -0.0728F}, {-0.1246F, 1.1329F, -0.0083F}, {-0.0182F, -0.1006F, 1.1187F}}};
  constexpr float kLast = kValues - 1;
  const bool is_wide = primaries_ == AVCOL_PRI_BT2020;
  for (std::size_t i = 0; i < shown.size(); ++i) {
    std::array<float, 3> light{light_[encoded[3 * i]], light_[encoded[3 * i + 1]], light_[encoded[3 * i + 2]]};
    if (!system_gain_.empty()) {
      const float luminance = 0.2627F * light[0] + 0.6780F * light[1] + 0.0593F * light[2];
      const float gain = system_gain_[static_cast<std::size_t>(std::min(luminance, 1.0F) * kLast)];
      for (float& channel : light) channel *= gain;
    }
    for (std::size_t c = 0; c < 3; ++c) {
      const float narrow =
          is_wide ? kTo709[c][0] * light[0] + kTo709[c][1] * light[1] + kTo709[c][2] * light[2] : light[c];
      shown[i][c] = level_[static_cast<std::size_t>(compressed(narrow) * kLast)];
    }
  }
}

}  // namespace tileflight::video
