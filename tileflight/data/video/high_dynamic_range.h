#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "tileflight/core/imaging/image.h"
#include "tileflight/data/video/libav.h"

namespace tileflight::video {

/// Maps images of high dynamic range, PQ or HLG (Rec. ITU-R BT.2100), to sRGB. The reference white of Report ITU-R
/// BT.2408, 203 cd/m2, becomes nearly white. Up to 80 % of it light is kept, and what is brighter is compressed, so
/// that it keeps its order. A BT.2020 gamut is converted to that of sRGB.
class HighDynamicRange {
 public:
  /// Tells whether a frame's values are encoded in one of the two ways.
  static bool has(AVColorTransferCharacteristic transfer) {
    return transfer == AVCOL_TRC_SMPTE2084 || transfer == AVCOL_TRC_ARIB_STD_B67;
  }

  HighDynamicRange(AVColorTransferCharacteristic transfer, AVColorPrimaries primaries);

  AVColorTransferCharacteristic transfer() const { return transfer_; }
  AVColorPrimaries primaries() const { return primaries_; }

  /// Maps pixels of 3 x 16 bits, red, green, blue. `shown` has as many pixels.
  void map(std::span<const std::uint16_t> encoded, std::span<imaging::Rgb8> shown) const;

 private:
  AVColorTransferCharacteristic transfer_;
  AVColorPrimaries primaries_;
  std::vector<float> light_;        ///< of each of the 65536 values; PQ: in reference whites, HLG: of the scene, 0 to 1
  std::vector<float> system_gain_;  ///< HLG: reference whites shown for light of the scene, by its luminance
  std::vector<std::uint8_t> level_;  ///< of sRGB, by compressed light
};

}  // namespace tileflight::video
