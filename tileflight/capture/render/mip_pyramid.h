#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "tileflight/core/imaging/image.h"

namespace tileflight::render {

/// One level: rows of 3-byte texels without padding. Eight bytes may be read from any address up to `last_load`.
struct MipLevel {
  const std::uint8_t* texels = nullptr;
  const std::uint8_t* last_load = nullptr;
  int width = 0;
  int height = 0;
};

/// A texture and its coarser versions, each half as large (rounded up), down to 1 x 1. Level 0 is the image itself, not
/// a copy (unless padding must be overwritten), so the pyramid adds a third to the texture's memory. Texels are
/// averaged in linear light, as in a sensor's pixel, and stored as sRGB bytes.
class MipPyramid {
 public:
  /// `coverage`: 255 for texels used by some triangle, 0 elsewhere (an atlas's padding); empty: all used. Coarser
  /// texels average only covered ones, and at every level uncovered texels take the colour of covered neighbours, so
  /// that padding does not bleed into surfaces.
  explicit MipPyramid(std::shared_ptr<const imaging::RgbImage> image, imaging::GrayImage coverage = {});

  int levels() const { return static_cast<int>(levels_.size()); }
  const MipLevel& level(int i) const { return levels_[static_cast<std::size_t>(i)]; }
  imaging::Rgb8 texel(int level, int x, int y) const;

 private:
  void add_level(const std::uint8_t* texels, int width, int height);

  std::shared_ptr<const imaging::RgbImage> image_;
  std::vector<std::vector<std::uint8_t>>
      storage_;  // of all levels stored here, each eight bytes longer than its texels
  std::vector<MipLevel> levels_;
};

}  // namespace tileflight::render
