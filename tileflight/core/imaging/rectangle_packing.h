#pragma once

#include <vector>

namespace tileflight::imaging {

struct PixelSize {
  int width = 0, height = 0;
};

struct PixelPosition {
  int x = 0, y = 0;  ///< top left corner
};

struct RectanglePacking {
  PixelSize size;                        ///< of the sheet
  std::vector<PixelPosition> positions;  ///< one per rectangle, in input order
};

/// Packs rectangles without overlap on one roughly square sheet, in shelves of decreasing height. Deterministic.
RectanglePacking pack_rectangles(const std::vector<PixelSize>& rectangles);

}  // namespace tileflight::imaging
