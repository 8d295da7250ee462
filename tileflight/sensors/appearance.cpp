#include "tileflight/sensors/appearance.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <unordered_map>

#include "tileflight/sensors/atlas.h"

namespace tileflight::sensors {
namespace {

using geometry::Vec3;
using imaging::TexturedMesh;

bool textured(const TexturedMesh& mesh) { return mesh.texture && !mesh.uv.empty(); }

std::array<float, 3> to_floats(const Vec3& v) {
  return {static_cast<float>(v.x()), static_cast<float>(v.y()), static_cast<float>(v.z())};
}

/// Gradients over the plane of the triangle with edges e1, e2 of the function that grows by a and b along them:
/// (a e2 x n + b n x e1) / |n|^2 with n = e1 x e2. Zero for a triangle without area.
Vec3 plane_gradient(const Vec3& e1, const Vec3& e2, double a, double b) {
  const Vec3 n = e1.cross(e2);
  const double squared = n.squaredNorm();
  if (squared < 1e-24) return Vec3::Zero();
  return (a * e2.cross(n) + b * n.cross(e1)) / squared;
}

TriangleShade shade_of(const TexturedMesh& mesh, const geometry::Triangle& t, int max_level) {
  const Eigen::Vector2f uv = mesh.uv[t[0]];
  const Eigen::Vector2f d1 = mesh.uv[t[1]] - uv;
  const Eigen::Vector2f d2 = mesh.uv[t[2]] - uv;
  const Vec3& origin = mesh.mesh.vertices[t[0]];
  const Vec3 e1 = mesh.mesh.vertices[t[1]] - origin;
  const Vec3 e2 = mesh.mesh.vertices[t[2]] - origin;
  const double width = mesh.texture->width;
  const double height = mesh.texture->height;
  TriangleShade shade{uv.x(), uv.y(), d1.x(), d1.y(), d2.x(), d2.y(), {}, {}, max_level};
  shade.texel_s = to_floats(width * plane_gradient(e1, e2, d1.x(), d2.x()));
  shade.texel_t = to_floats(height * plane_gradient(e1, e2, d1.y(), d2.y()));
  return shade;
}

bool is_plain(const TexturedMesh& mesh) {
  return textured(mesh) && mesh.colors.empty() && mesh.base_color[0] == 1.0F && mesh.base_color[1] == 1.0F &&
         mesh.base_color[2] == 1.0F;
}

Material material_of(const TexturedMesh& mesh, const MipPyramid* pyramid) {
  Material material;
  material.plain = is_plain(mesh);
  material.factor = {mesh.base_color[0], mesh.base_color[1], mesh.base_color[2]};
  if (!mesh.colors.empty()) material.colors = mesh.colors.data();
  if (pyramid != nullptr) {
    const bool inside = within_image(mesh);
    material.texture = {pyramid, inside ? imaging::Wrap::kClampToEdge : mesh.wrap_u,
                        inside ? imaging::Wrap::kClampToEdge : mesh.wrap_v, static_cast<float>(mesh.texture->width),
                        static_cast<float>(mesh.texture->height)};
  }
  return material;
}

/// Whether a texture lies on both in the same way.
bool same_surface(const TexturedMesh& a, const TexturedMesh& b) {
  return a.uv == b.uv && a.mesh.triangles == b.mesh.triangles && a.mesh.vertices == b.mesh.vertices;
}

}  // namespace

Appearance::Appearance(const scene::Scene& scene, const Appearance* before) : meshes_(&scene.meshes()) {
  find_skins();
  triangles_.resize(scene.triangle_count());
  std::vector<const Skin*> known(skins_.size(), nullptr);
  tbb::parallel_for(std::size_t{0}, skins_.size(), [&](std::size_t i) {
    if (before != nullptr) known[i] = same_skin(skins_[i], *before);
    skins_[i].pyramid = known[i] != nullptr ? known[i]->pyramid : pyramid_of(skins_[i]);
  });
  build_materials();
  tbb::parallel_for(std::size_t{0}, skins_.size(), [&](std::size_t i) {
    if (known[i] != nullptr) {
      take_over(skins_[i], *known[i], *before);
    } else {
      shade_skin(skins_[i]);
    }
  });
}

void Appearance::find_skins() {
  for (std::size_t i = 0; i < meshes_->size(); ++i) {
    const TexturedMesh& mesh = (*meshes_)[i];
    if (!textured(mesh)) continue;
    const std::size_t index = skin_of_texture_.emplace(mesh.texture.get(), skins_.size()).first->second;
    if (index == skins_.size()) skins_.emplace_back();
    skins_[index].meshes.push_back(static_cast<std::uint32_t>(i));
  }
}

/// The other's skin of this texture if it lies on the same triangles there; else null.
const Appearance::Skin* Appearance::same_skin(const Skin& skin, const Appearance& before) const {
  const auto at = before.skin_of_texture_.find((*meshes_)[skin.meshes[0]].texture.get());
  if (at == before.skin_of_texture_.end()) return nullptr;
  const Skin& other = before.skins_[at->second];
  const bool same = std::ranges::equal(skin.meshes, other.meshes, [&](std::uint32_t mine, std::uint32_t theirs) {
    return same_surface((*meshes_)[mine], (*before.meshes_)[theirs]);
  });
  return same ? &other : nullptr;
}

std::shared_ptr<const MipPyramid> Appearance::pyramid_of(const Skin& skin) const {
  std::vector<const TexturedMesh*> users;
  for (const std::uint32_t mesh : skin.meshes) users.push_back(&(*meshes_)[mesh]);
  return std::make_shared<const MipPyramid>(users[0]->texture, texture_coverage(users));
}

void Appearance::build_materials() {
  std::size_t first = 0;
  for (const TexturedMesh& mesh : *meshes_) {
    const MipPyramid* pyramid =
        textured(mesh) ? skins_[skin_of_texture_.at(mesh.texture.get())].pyramid.get() : nullptr;
    materials_.push_back(material_of(mesh, pyramid));
    materials_.back().first_triangle = first;
    first += mesh.mesh.triangles.size();
  }
}

/// Fills in the triangles of a skin's meshes.
void Appearance::shade_skin(const Skin& skin) {
  const int coarsest = skin.pyramid->levels() - 1;
  for (const std::uint32_t i : skin.meshes) {
    const TexturedMesh& mesh = (*meshes_)[i];
    const std::vector<std::int32_t> levels = chart_levels(mesh);
    TriangleShade* out = triangles_.data() + materials_[i].first_triangle;
    for (std::size_t t = 0; t < levels.size(); ++t)
      out[t] = shade_of(mesh, mesh.mesh.triangles[t], std::min(levels[t], coarsest));
  }
}

void Appearance::take_over(const Skin& skin, const Skin& known, const Appearance& before) {
  for (std::size_t k = 0; k < skin.meshes.size(); ++k) {
    const TriangleShade* from = before.triangles_.data() + before.materials_[known.meshes[k]].first_triangle;
    TriangleShade* to = triangles_.data() + materials_[skin.meshes[k]].first_triangle;
    std::copy_n(from, (*meshes_)[skin.meshes[k]].mesh.triangles.size(), to);
  }
}

}  // namespace tileflight::sensors
