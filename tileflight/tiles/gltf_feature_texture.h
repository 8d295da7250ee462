#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "tileflight/imaging/image.h"
#include "tileflight/imaging/textured_mesh.h"
#include "tileflight/tiles/gltf_geometry.h"

namespace tileflight::tiles::gltf {

/// A picture whose texels are feature ids (EXT_mesh_features, "Feature ID by Texture Coordinates").
struct FeatureTexture {
  std::shared_ptr<const imaging::RgbImage> image;
  imaging::Wrap wrap_u = imaging::Wrap::kRepeat;
  imaging::Wrap wrap_v = imaging::Wrap::kRepeat;
  std::vector<std::size_t> channels = {0};  ///< of red, green, blue: the id's bytes, the lowest first

  /// Of the texel that texture coordinates lie in; never filtered.
  std::uint32_t at(const Eigen::Vector2f& uv) const;
};

/// Gives each triangle of `geometry` the feature that stands at its middle, and its vertices with it: those that
/// triangles of several features share are doubled. `uv`: one a vertex.
void set_features(const FeatureTexture& texture, const std::vector<Eigen::Vector2f>& uv, Geometry& geometry);

}  // namespace tileflight::tiles::gltf
