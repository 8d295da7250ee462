#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "tileflight/core/imaging/textured_mesh.h"
#include "tileflight/core/imaging/rectangle_packing.h"

namespace tileflight::mesh_files {

/// A rectangle of texels of an image; it may extend beyond the edges.
struct TexelWindow {
  std::int64_t x = 0, y = 0;           ///< top left texel
  std::int64_t width = 0, height = 0;  ///< texels

  std::int64_t area() const { return width * height; }
};

/// Smallest window that contains both.
TexelWindow bounding_window(const TexelWindow& a, const TexelWindow& b);

/// Result of merge_overlapping(): windows are merged if their bounding window is no larger than both together;
/// `merged_index` holds, for each input window, the index of the merged window that contains it.
struct MergedWindows {
  std::vector<TexelWindow> windows;
  std::vector<std::size_t> merged_index;
};
MergedWindows merge_overlapping(const std::vector<TexelWindow>& windows);

/// The texel at (x, y) of the mesh's texture; beyond the edges, by its wrap modes.
imaging::Rgb8 wrapped_texel(const imaging::TexturedMesh& mesh, std::int64_t x, std::int64_t y);

/// Texel (x, y) of an image. The image may be a stand-in whose size alone is known, with its pixels elsewhere.
using TexelFetcher = std::function<imaging::Rgb8(const imaging::RgbImage& image, int x, int y)>;

/// Texels of images in memory.
TexelFetcher fetch_from_memory();

/// Draws a window of a mesh's texture into an atlas: a copy if `size` is the window's, otherwise area-averaged.
void draw_window(const imaging::TexturedMesh& mesh, const TexelFetcher& fetch, const TexelWindow& window,
                 imaging::PixelPosition at, imaging::PixelSize size, imaging::RgbImage& sheet);

}  // namespace tileflight::mesh_files
