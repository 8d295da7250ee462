#pragma once

#include <array>
#include <cstdint>
#include <memory>
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
class Appearance {
 public:
  explicit Appearance(const scene::Scene& scene);

  const Material& material(std::uint32_t mesh) const { return materials_[mesh]; }
  const TriangleShade& shade(const Material& material, std::uint32_t triangle) const {
    return triangles_[material.first_triangle + triangle];
  }

 private:
  void build_pyramids(const scene::Scene& scene);
  void build_materials(const scene::Scene& scene);

  std::vector<std::unique_ptr<MipPyramid>> pyramids_;
  std::vector<const MipPyramid*> pyramid_of_mesh_;
  std::vector<Material> materials_;
  std::vector<TriangleShade> triangles_;
};

}  // namespace tileflight::sensors
