#include "tileflight/render/appearance.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <unordered_map>

#include "tileflight/render/texture_atlas.h"

namespace tileflight::render {
namespace {

using geometry::Vec3;
using imaging::TexturedMesh;

bool has_texture(const TexturedMesh& mesh) { return mesh.texture && !mesh.uv.empty(); }

std::array<float, 3> to_floats(const Vec3& v) {
  return {static_cast<float>(v.x()), static_cast<float>(v.y()), static_cast<float>(v.z())};
}

/// Gradient, in the plane of the triangle with edges e1 and e2, of the linear function that increases by a and b along
/// them: (a e2 x n + b n x e1) / |n|^2 with n = e1 x e2. Zero for a degenerate triangle.
Vec3 plane_gradient(const Vec3& e1, const Vec3& e2, double a, double b) {
  const Vec3 n = e1.cross(e2);
  const double squared = n.squaredNorm();
  if (squared < 1e-24) return Vec3::Zero();
  return (a * e2.cross(n) + b * n.cross(e1)) / squared;
}

TriangleShading shade_of(const TexturedMesh& mesh, const geometry::Triangle& t, int max_level) {
  const Eigen::Vector2f uv = mesh.uv[t[0]];
  const Eigen::Vector2f d1 = mesh.uv[t[1]] - uv;
  const Eigen::Vector2f d2 = mesh.uv[t[2]] - uv;
  const Vec3& origin = mesh.mesh.vertices[t[0]];
  const Vec3 e1 = mesh.mesh.vertices[t[1]] - origin;
  const Vec3 e2 = mesh.mesh.vertices[t[2]] - origin;
  const double width = mesh.texture->width;
  const double height = mesh.texture->height;
  TriangleShading shade{uv.x(), uv.y(), d1.x(), d1.y(), d2.x(), d2.y(), {}, {}, max_level};
  shade.texel_s = to_floats(width * plane_gradient(e1, e2, d1.x(), d2.x()));
  shade.texel_t = to_floats(height * plane_gradient(e1, e2, d1.y(), d2.y()));
  return shade;
}

bool is_plain(const TexturedMesh& mesh) {
  return has_texture(mesh) && mesh.colors.empty() && mesh.base_color[0] == 1.0F && mesh.base_color[1] == 1.0F &&
         mesh.base_color[2] == 1.0F;
}

Material material_of(const TexturedMesh& mesh, const MipPyramid* pyramid) {
  Material material;
  material.texture_only = is_plain(mesh);
  material.factor = {mesh.base_color[0], mesh.base_color[1], mesh.base_color[2]};
  if (!mesh.colors.empty()) material.vertex_colors = mesh.colors.data();
  if (pyramid != nullptr) {
    const bool inside = within_image(mesh);
    material.texture = {pyramid, inside ? imaging::Wrap::kClampToEdge : mesh.wrap_u,
                        inside ? imaging::Wrap::kClampToEdge : mesh.wrap_v, static_cast<float>(mesh.texture->width),
                        static_cast<float>(mesh.texture->height)};
  }
  return material;
}

/// Whether two meshes have the same triangles and texture coordinates.
bool same_surface(const TexturedMesh& a, const TexturedMesh& b) {
  return a.uv == b.uv && a.mesh.triangles == b.mesh.triangles && a.mesh.vertices == b.mesh.vertices;
}

}  // namespace

Appearance::Appearance(const scene::Scene& scene, const Appearance* before) : meshes_(&scene.meshes()) {
  group_meshes_by_texture();
  triangles_.resize(scene.triangle_count());
  std::vector<const TextureGroup*> known(texture_groups_.size(), nullptr);
  tbb::parallel_for(std::size_t{0}, texture_groups_.size(), [&](std::size_t i) {
    if (before != nullptr) known[i] = find_matching_group(texture_groups_[i], *before);
    texture_groups_[i].pyramid = known[i] != nullptr ? known[i]->pyramid : build_pyramid(texture_groups_[i]);
  });
  build_materials();
  tbb::parallel_for(std::size_t{0}, texture_groups_.size(), [&](std::size_t i) {
    if (known[i] != nullptr) {
      copy_triangle_shading(texture_groups_[i], *known[i], *before);
    } else {
      compute_triangle_shading(texture_groups_[i]);
    }
  });
}

void Appearance::group_meshes_by_texture() {
  for (std::size_t i = 0; i < meshes_->size(); ++i) {
    const TexturedMesh& mesh = (*meshes_)[i];
    if (!has_texture(mesh)) continue;
    const std::size_t index = group_of_texture_.emplace(mesh.texture.get(), texture_groups_.size()).first->second;
    if (index == texture_groups_.size()) texture_groups_.emplace_back();
    texture_groups_[index].meshes.push_back(static_cast<std::uint32_t>(i));
  }
}

/// The texture group of `before` with this texture on the same triangles; null if there is none.
const Appearance::TextureGroup* Appearance::find_matching_group(const TextureGroup& skin,
                                                                const Appearance& before) const {
  const auto at = before.group_of_texture_.find((*meshes_)[skin.meshes[0]].texture.get());
  if (at == before.group_of_texture_.end()) return nullptr;
  const TextureGroup& other = before.texture_groups_[at->second];
  const bool same = std::ranges::equal(skin.meshes, other.meshes, [&](std::uint32_t mine, std::uint32_t theirs) {
    return same_surface((*meshes_)[mine], (*before.meshes_)[theirs]);
  });
  return same ? &other : nullptr;
}

std::shared_ptr<const MipPyramid> Appearance::build_pyramid(const TextureGroup& skin) const {
  std::vector<const TexturedMesh*> users;
  for (const std::uint32_t mesh : skin.meshes) users.push_back(&(*meshes_)[mesh]);
  return std::make_shared<const MipPyramid>(users[0]->texture, texture_coverage(users));
}

void Appearance::build_materials() {
  std::size_t first = 0;
  for (const TexturedMesh& mesh : *meshes_) {
    const MipPyramid* pyramid =
        has_texture(mesh) ? texture_groups_[group_of_texture_.at(mesh.texture.get())].pyramid.get() : nullptr;
    materials_.push_back(material_of(mesh, pyramid));
    materials_.back().first_triangle = first;
    first += mesh.mesh.triangles.size();
  }
}

/// Computes the shading data of all triangles in the group's meshes.
void Appearance::compute_triangle_shading(const TextureGroup& skin) {
  const int coarsest = skin.pyramid->levels() - 1;
  for (const std::uint32_t i : skin.meshes) {
    const TexturedMesh& mesh = (*meshes_)[i];
    const std::vector<std::int32_t> levels = chart_max_mip_levels(mesh);
    TriangleShading* out = triangles_.data() + materials_[i].first_triangle;
    for (std::size_t t = 0; t < levels.size(); ++t)
      out[t] = shade_of(mesh, mesh.mesh.triangles[t], std::min(levels[t], coarsest));
  }
}

void Appearance::copy_triangle_shading(const TextureGroup& skin, const TextureGroup& known, const Appearance& before) {
  for (std::size_t k = 0; k < skin.meshes.size(); ++k) {
    const TriangleShading* from = before.triangles_.data() + before.materials_[known.meshes[k]].first_triangle;
    TriangleShading* to = triangles_.data() + materials_[skin.meshes[k]].first_triangle;
    std::copy_n(from, (*meshes_)[skin.meshes[k]].mesh.triangles.size(), to);
  }
}

}  // namespace tileflight::render
