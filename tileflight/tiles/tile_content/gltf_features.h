#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/core/imaging/image.h"
#include "tileflight/core/imaging/textured_mesh.h"
#include "tileflight/tiles/tile_content/gltf_buffers.h"
#include "tileflight/tiles/tile_content/gltf_document.h"
#include "tileflight/tiles/tile_content/gltf_geometry.h"

namespace tileflight::tile_content::gltf {

/// An image whose texels are feature ids (EXT_mesh_features, "Feature ID by Texture Coordinates").
struct FeatureTexture {
  std::shared_ptr<const imaging::RgbImage> image;
  imaging::Wrap wrap_u = imaging::Wrap::kRepeat;
  imaging::Wrap wrap_v = imaging::Wrap::kRepeat;
  std::vector<std::size_t> channels = {0};  ///< indices into red, green, blue: the bytes of the id, lowest first

  /// Returns the feature id of the texel at the texture coordinates, unfiltered.
  std::uint32_t at(const Eigen::Vector2f& uv) const;
};

/// Assigns to each triangle of `geometry`, and to its vertices, the feature at the triangle's centre; vertices shared
/// by triangles of several features are duplicated. `uv`: one per vertex.
void assign_features_from_texture(const FeatureTexture& texture, const std::vector<Eigen::Vector2f>& uv,
                                  Geometry& geometry);

/// Provides the property tables of a glTF (EXT_structural_metadata) as feature tables. Each is read on first use.
class PropertyTables {
 public:
  /// All arguments must outlive this object.
  PropertyTables(const Document& document, Buffers& buffers, const ContentOptions& options, const std::string& name)
      : document_(document), buffers_(buffers), options_(options), name_(name) {}

  /// Returns a table. If it does not exist or cannot be read, adds one warning and returns nullptr.
  std::shared_ptr<const imaging::FeatureTable> table(std::size_t index, std::vector<std::string>& warnings);

 private:
  std::shared_ptr<const imaging::FeatureTable> read(std::size_t index);

  const Document& document_;
  Buffers& buffers_;
  const ContentOptions& options_;
  const std::string& name_;
  std::map<std::size_t, std::shared_ptr<const imaging::FeatureTable>> tables_;
};

}  // namespace tileflight::tile_content::gltf
