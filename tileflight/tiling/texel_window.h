#pragma once

#include <cstdint>
#include <vector>

#include "tileflight/imaging/textured_mesh.h"
#include "tileflight/tiling/pack.h"

namespace tileflight::tiling {

/// A rectangle of texels of a picture, which may reach beyond its edges.
struct TexelWindow {
  std::int64_t x = 0, y = 0;           ///< top left texel
  std::int64_t width = 0, height = 0;  ///< texels

  std::int64_t area() const { return width * height; }
};

/// Smallest window around both.
TexelWindow around(const TexelWindow& a, const TexelWindow& b);

/// The windows with those joined that overlap so much that one around them is no larger than both; `window_of` has for
/// each of the given ones the joined one that holds it.
struct JoinedWindows {
  std::vector<TexelWindow> windows;
  std::vector<std::size_t> window_of;
};
JoinedWindows join_overlapping(const std::vector<TexelWindow>& windows);

/// The texel at (x, y) of a picture that goes on beyond its edges as its wrapping says.
imaging::Rgb8 wrapped_texel(const imaging::TexturedMesh& mesh, std::int64_t x, std::int64_t y);

/// Draws the window of a mesh's texture into a sheet: texel by texel where the size is the window's, else each pixel is
/// the mean of what it covers.
void draw_window(const imaging::TexturedMesh& mesh, const TexelWindow& window, PixelPlace at, PixelSize size,
                 imaging::RgbImage& sheet);

}  // namespace tileflight::tiling
