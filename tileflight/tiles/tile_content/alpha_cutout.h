#pragma once

#include <cstdint>
#include <span>

#include "tileflight/core/imaging/image.h"
#include "tileflight/core/imaging/textured_mesh.h"
#include "tileflight/tiles/tile_content/gltf_geometry.h"

namespace tileflight::tile_content::gltf {

/// Where a texture is opaque, and how its coordinates wrap.
struct OpacityMask {
  const imaging::GrayImage& alpha;
  std::uint8_t least_opaque = 128;  ///< texels of this alpha and above are surface
  imaging::Wrap wrap_u = imaging::Wrap::kRepeat;
  imaging::Wrap wrap_v = imaging::Wrap::kRepeat;
};

/// Cuts out the parts of a surface whose texels are transparent: triangles are divided along the borders of texels, so
/// that images, depth and ground truth all see the same surface. `uv`: texture coordinates of the vertices, after any
/// transform. Triangles that are opaque stay as they are. If the pieces would be too many, cells of several texels are
/// kept or left out by the share of their opaque texels. Returns the side of the cells in texels: 1 for an exact cut,
/// 0 if nothing had to be cut, -1 if the coordinates repeat the image too often, so that the surface stays whole.
int cut_out(const OpacityMask& mask, std::span<const Eigen::Vector2f> uv, Geometry& geometry);

}  // namespace tileflight::tile_content::gltf
