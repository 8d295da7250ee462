#pragma once

// Photogrammetry packs many pieces of surface (charts) into one texture, with padding between them. Coarse mip levels
// mix texels that are adjacent there but not on the surface; the functions below prevent that.

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <unordered_map>
#include <vector>

#include "tileflight/capture/render/linear_color.h"
#include "tileflight/capture/render/texture_sampler.h"
#include "tileflight/core/imaging/textured_mesh.h"
#include "tileflight/world/scene/scene.h"

namespace tileflight::render {

/// Most surfaces along a ray that are blended; the last of them is shown opaque.
inline constexpr int kMostBlendedSurfaces = 16;

/// Returns the memory of a mesh's arrays, without its texture.
std::uintmax_t decoded_bytes(const imaging::TexturedMesh& mesh);

/// Returns the memory of a mesh in a scene that is rendered: its data, both of the scene's trees over it and its
/// shading (Appearance), without its texture.
std::uintmax_t rendered_bytes(const imaging::TexturedMesh& mesh);

/// Returns the memory of a texture in a scene that is rendered: with its coarser levels and, for an atlas, a copy with
/// its padding overwritten.
std::uintmax_t rendered_bytes(const imaging::RgbImage& texture);

/// Tells whether all texture coordinates lie within 0..1 (with a tolerance of a thousandth). Reads at the edge of such
/// a texture need not wrap around.
bool within_image(const imaging::TexturedMesh& mesh);

/// Returns a mask of 255 for each texel touched by a triangle of `meshes`, 0 for padding. All meshes have the same
/// texture and texture coordinates. Empty if all texels are used, or if coordinates leave 0..1 (a repeating texture has
/// no padding).
imaging::GrayImage texture_coverage(std::span<const imaging::TexturedMesh* const> meshes);

/// Returns for each triangle the mip level whose texels are about as wide as its chart (triangles connected by common
/// texture coordinates). Coarser texels would mix in other charts.
std::vector<std::int32_t> chart_max_mip_levels(const imaging::TexturedMesh& mesh);

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
  const TriangleShading* triangles = nullptr;                  ///< one per triangle
  bool blends = false;                                         ///< what lies behind the surface shows through
  float opacity = 1.0F;                                        ///< of the whole surface, if it blends
  const MipPyramid* opacity_texture = nullptr;                 ///< opacity as linear light, or null
};

/// Mip pyramids (one per texture, shared by all its meshes) and per-triangle texture gradients of a part of a scene.
/// Costs 64 bytes a triangle and a third of the textures' size. Immutable; several scenes that hold the part may share
/// it.
class PartAppearance {
 public:
  explicit PartAppearance(std::shared_ptr<const scene::ScenePart> part);

  /// Returns the materials, one for each mesh of the part.
  const std::vector<Material>& materials() const { return materials_; }

  /// Computes all pyramids now, in parallel, for a scene whose first image must not wait. Otherwise each is computed
  /// when a ray first meets its texture.
  void build_pyramids() const;

 private:
  /// The meshes that use one texture.
  struct TextureGroup {
    std::shared_ptr<const MipPyramid> pyramid;
    std::shared_ptr<const imaging::RgbImage> opacity_image{};  ///< null: opaque
    std::shared_ptr<const MipPyramid> opacity{};               ///< of that image
    std::vector<std::uint32_t> meshes;
  };

  void group_meshes_by_texture();
  std::shared_ptr<const MipPyramid> make_pyramid(const TextureGroup& skin,
                                                 std::shared_ptr<const imaging::RgbImage> image) const;
  void build_materials();
  void compute_triangle_shading(const TextureGroup& skin);

  std::shared_ptr<const scene::ScenePart> part_;
  const std::vector<imaging::TexturedMesh>* meshes_;  ///< of the part
  std::vector<TextureGroup> texture_groups_;
  std::unordered_map<const imaging::RgbImage*, std::size_t> group_of_texture_;
  std::vector<Material> materials_;
  std::vector<std::size_t> first_triangle_;  ///< of each mesh, index into triangles_
  std::vector<TriangleShading> triangles_;
};

/// The appearance of a scene: that of its parts. Immutable; may be shared by several cameras, and may outlive the
/// scene.
class Appearance {
 public:
  explicit Appearance(const scene::Scene& scene);
  /// From the appearances of the scene's parts, in their order, and of its placed parts.
  explicit Appearance(std::vector<std::shared_ptr<const PartAppearance>> parts);

  const Material& material(std::uint32_t mesh) const { return materials_[mesh]; }
  bool has_blending() const { return has_blending_; }  ///< whether there is any surface that blends
  static const TriangleShading& triangle_shading(const Material& material, std::uint32_t triangle) {
    return material.triangles[triangle];
  }

 private:
  std::vector<std::shared_ptr<const PartAppearance>> parts_;
  std::vector<Material> materials_;
  bool has_blending_ = false;
};

}  // namespace tileflight::render
