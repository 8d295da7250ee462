#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <unordered_map>
#include <vector>

#include "tileflight/render/linear_color.h"
#include "tileflight/render/texture_sampler.h"
#include "tileflight/scene/scene.h"

namespace tileflight::render {

/// Shading data of a triangle, in one cache line.
struct alignas(64) TriangleShading {
  float s = 0.0F, t = 0.0F;      ///< texture coordinates of corner 0
  float s_u = 0.0F, t_u = 0.0F;  ///< change to corner 1
  float s_v = 0.0F, t_v = 0.0F;  ///< change to corner 2
  std::array<float, 3> texel_s{},
      texel_t{};               ///< gradient of the texel column and row over the triangle's plane, texels a metre
  std::int32_t max_level = 0;  ///< coarsest mip level without texels of other surfaces
};

/// Appearance of a mesh.
struct Material {
  Texture texture;                                             ///< pyramid is null if there is no texture
  bool texture_only = true;                                    ///< true: no base colour or vertex colours to multiply
  LinearRgb factor{1, 1, 1};                                   ///< linear base colour
  const std::array<std::uint8_t, 4>* vertex_colors = nullptr;  ///< one per vertex, linear, or null
  std::size_t first_triangle = 0;                              ///< of the mesh in Appearance::triangles
};

/// Mip pyramids (one per texture, shared by all its meshes) and per-triangle texture gradients of a scene. Costs 64
/// bytes a triangle and a third of the textures' size. Immutable; may be shared by several cameras. The scene must
/// outlive it.
///
/// If constructed with another scene's appearance, it reuses that one's data for the same texture on the same triangles
/// (pyramids are shared, not copied); the result is bit-identical to a new one. The other appearance may be destroyed
/// afterwards.
class Appearance {
 public:
  /// `before`, if given, and its scene must be valid during the constructor.
  explicit Appearance(const scene::Scene& scene, const Appearance* before = nullptr);

  const Material& material(std::uint32_t mesh) const { return materials_[mesh]; }
  const TriangleShading& triangle_shading(const Material& material, std::uint32_t triangle) const {
    return triangles_[material.first_triangle + triangle];
  }

 private:
  /// The meshes that use one texture.
  struct TextureGroup {
    std::shared_ptr<const MipPyramid> pyramid;
    std::vector<std::uint32_t> meshes;
  };

  void group_meshes_by_texture();
  const TextureGroup* find_matching_group(const TextureGroup& skin, const Appearance& before) const;
  std::shared_ptr<const MipPyramid> build_pyramid(const TextureGroup& skin) const;
  void build_materials();
  void compute_triangle_shading(const TextureGroup& skin);
  void copy_triangle_shading(const TextureGroup& skin, const TextureGroup& known, const Appearance& before);

  const std::vector<imaging::TexturedMesh>* meshes_;  ///< of the scene
  std::vector<TextureGroup> texture_groups_;
  std::unordered_map<const imaging::RgbImage*, std::size_t> group_of_texture_;
  std::vector<Material> materials_;
  std::vector<TriangleShading> triangles_;
};

}  // namespace tileflight::render
