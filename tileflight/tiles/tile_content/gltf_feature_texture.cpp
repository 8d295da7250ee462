#include "tileflight/tiles/tile_content/gltf_feature_texture.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

namespace tileflight::tile_content::gltf {
namespace {

int texel_of(float coordinate, int count, imaging::Wrap wrap) {
  double place = std::isfinite(coordinate) ? coordinate : 0.0;
  if (wrap == imaging::Wrap::kRepeat) place -= std::floor(place);
  if (wrap == imaging::Wrap::kMirroredRepeat) {
    place = std::abs(std::remainder(place, 2.0));  // 0 at even integers, 1 at odd ones
  }
  return static_cast<int>(std::clamp(std::floor(place * count), 0.0, count - 1.0));
}

template <class T>
void append_copy(std::vector<T>& values, std::size_t components, std::size_t vertex) {
  if (values.empty()) return;
  for (std::size_t c = 0; c < components; ++c) values.push_back(T(values[vertex * components + c]));
}

std::uint32_t copy_of(std::uint32_t vertex, Geometry& geometry) {
  const auto copy = static_cast<std::uint32_t>(geometry.vertex_count());
  append_copy(geometry.positions, 3, vertex);
  append_copy(geometry.tex_coords, 2, vertex);
  append_copy(geometry.colors, geometry.color_components, vertex);
  return copy;
}

}  // namespace

std::uint32_t FeatureTexture::at(const Eigen::Vector2f& uv) const {
  const imaging::Rgb8& texel =
      (*image)(texel_of(uv.x(), image->width, wrap_u), texel_of(uv.y(), image->height, wrap_v));
  std::uint32_t id = 0;
  for (std::size_t i = 0; i < channels.size(); ++i) id |= std::uint32_t{texel[channels[i]]} << (8 * i);
  return id;
}

void assign_features_from_texture(const FeatureTexture& texture, const std::vector<Eigen::Vector2f>& uv,
                                  Geometry& geometry) {
  std::vector<std::uint32_t> ids(geometry.vertex_count(), imaging::kNoFeature);
  std::vector<bool> taken(geometry.vertex_count(), false);
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t> copies;  // by vertex and feature
  for (geometry::Triangle& triangle : geometry.triangles) {
    const std::uint32_t id = texture.at((uv[triangle[0]] + uv[triangle[1]] + uv[triangle[2]]) / 3.0F);
    for (std::uint32_t& corner : triangle) {
      if (!taken[corner]) {
        taken[corner] = true;
        ids[corner] = id;
      } else if (ids[corner] != id) {
        const auto [known, is_new] = copies.try_emplace({corner, id}, 0);
        if (is_new) {
          known->second = copy_of(corner, geometry);
          ids.push_back(id);
        }
        corner = known->second;
      }
    }
  }
  geometry.feature_ids = std::move(ids);
}

}  // namespace tileflight::tile_content::gltf
