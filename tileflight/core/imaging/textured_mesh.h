#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "tileflight/core/geometry/mesh.h"
#include "tileflight/core/imaging/image.h"

namespace tileflight::imaging {

/// Feature id of a vertex that belongs to no feature.
inline constexpr std::uint32_t kNoFeature = std::numeric_limits<std::uint32_t>::max();

/// Properties of the features (buildings, trees, …) that parts of a mesh belong to.
struct FeatureTable {
  std::size_t count = 0;
  std::map<std::string, std::vector<std::string>> properties;  ///< `count` values each, as text

  /// The feature's name: its value of the first existing property among "name", "Name", "gml:name", "gml_id", "gml:id"
  /// and "id"; otherwise its number.
  std::string name(std::uint32_t feature) const {
    for (const char* key : {"name", "Name", "gml:name", "gml_id", "gml:id", "id"}) {
      const auto values = properties.find(key);
      if (values != properties.end() && feature < values->second.size() && !values->second[feature].empty()) {
        return values->second[feature];
      }
    }
    return std::to_string(feature);
  }
};

/// Handling of texture coordinates outside 0..1 (glTF sampler).
enum class Wrap { kRepeat, kClampToEdge, kMirroredRepeat };

/// Returns the index of the texel that is read for texel `at` of a row or column of `size` texels.
inline std::int64_t wrapped_index(std::int64_t at, std::int64_t size, Wrap wrap) {
  if (at >= 0 && at < size) return at;
  if (wrap == Wrap::kClampToEdge) return std::clamp<std::int64_t>(at, 0, size - 1);
  const std::int64_t period = wrap == Wrap::kRepeat ? size : 2 * size;
  const std::int64_t within = (at % period + period) % period;
  return within < size ? within : period - 1 - within;
}

/// Triangles of one material. Positions are double, in a frame defined by the owner (a tile: the tileset's frame; a
/// scene: local). `uv` follows glTF: (0, 0) is the top left corner of the image.
struct TexturedMesh {
  geometry::TriangleMesh mesh;
  std::vector<Eigen::Vector2f> uv;                  ///< one a vertex, or empty
  std::vector<std::array<std::uint8_t, 4>> colors;  ///< one a vertex (RGBA), or empty
  std::shared_ptr<const RgbImage> texture;          ///< shared between meshes that use the same image; may be null
  Wrap wrap_u = Wrap::kRepeat;
  Wrap wrap_v = Wrap::kRepeat;
  std::array<float, 4> base_color{1.0F, 1.0F, 1.0F, 1.0F};  ///< glTF's linear factor on texture and colours
  /// Whether images blend the surface with what lies behind it, by the fourth numbers of base_color and colors and by
  /// `opacity`. Depth and ground truth take it as solid, as they do all surfaces.
  bool blends = false;
  /// Opacity of the texels of `texture`: grey, with linear light as the opacity, so that it is filtered as colours are.
  /// Null: opaque.
  std::shared_ptr<const RgbImage> opacity{};
  std::vector<std::uint32_t> feature_ids;        ///< one a vertex (kNoFeature: none), or empty
  std::shared_ptr<const FeatureTable> features;  ///< of feature_ids; shared between meshes of a tile; may be null
  std::string name;                              ///< tile or object of origin, for messages and labels
};

/// Returns the bytes of a mesh's vertices and their attributes in memory, without the texture, which meshes share.
inline std::size_t vertex_bytes(const TexturedMesh& mesh) {
  return mesh.mesh.vertices.size() * sizeof(mesh.mesh.vertices[0]) + mesh.uv.size() * sizeof(mesh.uv[0]) +
         mesh.colors.size() * sizeof(mesh.colors[0]) + mesh.feature_ids.size() * sizeof(mesh.feature_ids[0]);
}

}  // namespace tileflight::imaging
