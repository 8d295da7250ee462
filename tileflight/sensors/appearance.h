#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <unordered_map>
#include <vector>

#include "tileflight/scene/scene.h"
#include "tileflight/sensors/light.h"
#include "tileflight/sensors/texture_sampler.h"

namespace tileflight::sensors {

/// What the renderer needs of a triangle beside its hit, in one cache line.
struct alignas(64) TriangleShade {
  float s = 0.0F, t = 0.0F;      ///< texture coordinates of corner 0
  float s_u = 0.0F, t_u = 0.0F;  ///< change to corner 1
  float s_v = 0.0F, t_v = 0.0F;  ///< change to corner 2
  std::array<float, 3> texel_s{},
      texel_t{};               ///< gradient of the texel column and row over the triangle's plane, texels a metre
  std::int32_t max_level = 0;  ///< coarsest mip level that still belongs to this surface
};

/// How a mesh looks.
struct Material {
  Texture texture;                                      ///< pyramid is null where there is none
  bool plain = true;                                    ///< texture only: nothing to multiply
  Light factor{1, 1, 1};                                ///< linear base colour
  const std::array<std::uint8_t, 4>* colors = nullptr;  ///< a vertex each, linear, or null
  std::size_t first_triangle = 0;                       ///< of the mesh in Appearance::triangles
};

/// Mip pyramids (one a texture, however many meshes share it) and per-triangle texture gradients of a scene. Costs 64
/// bytes a triangle and a third of the textures' size. Immutable; may be shared by several cameras. The scene must
/// outlive it.
///
/// Made with the appearance of another scene, it takes over what that one has of the same texture on the same triangles
/// (pyramids are shared, not copied) and is the same to the last bit as if made anew. Of the other nothing need live
/// on.
class Appearance {
 public:
  /// `before`, if any, and its scene must be there until this returns.
  explicit Appearance(const scene::Scene& scene, const Appearance* before = nullptr);

  const Material& material(std::uint32_t mesh) const { return materials_[mesh]; }
  const TriangleShade& shade(const Material& material, std::uint32_t triangle) const {
    return triangles_[material.first_triangle + triangle];
  }

 private:
  /// The meshes that one texture lies on.
  struct Skin {
    std::shared_ptr<const MipPyramid> pyramid;
    std::vector<std::uint32_t> meshes;
  };

  void find_skins();
  const Skin* same_skin(const Skin& skin, const Appearance& before) const;
  std::shared_ptr<const MipPyramid> pyramid_of(const Skin& skin) const;
  void build_materials();
  void shade_skin(const Skin& skin);
  void take_over(const Skin& skin, const Skin& known, const Appearance& before);

  const std::vector<imaging::TexturedMesh>* meshes_;  ///< of the scene
  std::vector<Skin> skins_;
  std::unordered_map<const imaging::RgbImage*, std::size_t> skin_of_texture_;
  std::vector<Material> materials_;
  std::vector<TriangleShade> triangles_;
};

}  // namespace tileflight::sensors
