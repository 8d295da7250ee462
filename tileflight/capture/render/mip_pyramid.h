#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
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
/// averaged in linear light, as in a sensor's pixel, and stored as sRGB bytes. The levels are computed when one is
/// first asked for, since a flight sees few of a place's textures. Thread safe.
class MipPyramid {
 public:
  /// `coverage`: returns 255 for texels used by some triangle, 0 elsewhere (an atlas's padding); null, or an empty
  /// result: all used. Coarser texels average only covered ones, and at every level uncovered texels take the colour of
  /// covered neighbours, so that padding does not bleed into surfaces. What it refers to must outlive the pyramid.
  explicit MipPyramid(std::shared_ptr<const imaging::RgbImage> image,
                      std::function<imaging::GrayImage()> coverage = nullptr);

  int levels() const { return level_count_; }
  const MipLevel& level(int i) const {
    const MipLevel* first = first_level_.load(std::memory_order_acquire);
    if (first == nullptr) [[unlikely]]
      first = build();
    return first[i];
  }
  imaging::Rgb8 texel(int level, int x, int y) const;
  /// Computes the levels now if they are not there.
  const MipLevel* build() const;

 private:
  void compute_levels() const;
  void add_level(const std::uint8_t* texels, int width, int height) const;

  std::shared_ptr<const imaging::RgbImage> image_;
  std::function<imaging::GrayImage()> coverage_;
  int level_count_ = 1;
  mutable std::once_flag once_;
  mutable std::atomic<const MipLevel*> first_level_ = nullptr;  ///< null: not computed
  mutable std::vector<std::vector<std::uint8_t>>
      storage_;  // of all levels stored here, each eight bytes longer than its texels
  mutable std::vector<MipLevel> levels_;
};

}  // namespace tileflight::render
