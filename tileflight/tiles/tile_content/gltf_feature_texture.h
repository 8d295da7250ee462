#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "tileflight/core/imaging/image.h"
#include "tileflight/core/imaging/textured_mesh.h"
#include "tileflight/tiles/tile_content/gltf_geometry.h"

namespace tileflight::tile_content::gltf {

/// An image whose texels are feature ids (EXT_mesh_features, "Feature ID by Texture Coordinates").
struct FeatureTexture {
  std::shared_ptr<const imaging::RgbImage> image;
  imaging::Wrap wrap_u = imaging::Wrap::kRepeat;
  imaging::Wrap wrap_v = imaging::Wrap::kRepeat;
  std::vector<std::size_t> channels = {0};  ///< indices into red, green, blue: the bytes of the id, lowest first

  /// Feature id of the texel at the texture coordinates, unfiltered.
  std::uint32_t at(const Eigen::Vector2f& uv) const;
};

/// Assigns to each triangle of `geometry`, and to its vertices, the feature at the triangle's centre; vertices shared
/// by triangles of several features are duplicated. `uv`: one per vertex.
void assign_features_from_texture(const FeatureTexture& texture, const std::vector<Eigen::Vector2f>& uv,
                                  Geometry& geometry);

}  // namespace tileflight::tile_content::gltf
