#pragma once

#include <vector>

namespace tileflight::tiling {

struct PixelSize {
  int width = 0, height = 0;
};

struct PixelPlace {
  int x = 0, y = 0;  ///< top left corner
};

struct Packing {
  PixelSize size;                  ///< of the sheet
  std::vector<PixelPlace> places;  ///< one a rectangle, in the order given
};

/// Places rectangles on one sheet without overlap, on shelves of falling height, about as wide as high. The same input
/// gives the same sheet.
Packing pack_rectangles(const std::vector<PixelSize>& rectangles);

}  // namespace tileflight::tiling
