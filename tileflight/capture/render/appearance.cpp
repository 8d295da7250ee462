#include "tileflight/capture/render/appearance.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <utility>

#include "tileflight/capture/render/texture_atlas.h"

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

std::vector<std::shared_ptr<const PartAppearance>> appearances_of(const scene::Scene& scene) {
  std::vector<std::shared_ptr<const PartAppearance>> parts(scene.parts().size());
  tbb::parallel_for(std::size_t{0}, parts.size(),
                    [&](std::size_t i) { parts[i] = std::make_shared<const PartAppearance>(scene.parts()[i]); });
  std::unordered_map<const scene::ScenePart*, std::shared_ptr<const PartAppearance>> of_placed;
  for (const scene::PlacedPart& placed : scene.placed()) {
    std::shared_ptr<const PartAppearance>& appearance = of_placed[placed.part.get()];
    if (!appearance) appearance = std::make_shared<const PartAppearance>(placed.part);
    parts.push_back(appearance);
  }
  return parts;
}

}  // namespace

PartAppearance::PartAppearance(std::shared_ptr<const scene::ScenePart> part)
    : part_(std::move(part)), meshes_(&part_->meshes()), triangles_(part_->triangle_count()) {
  group_meshes_by_texture();
  tbb::parallel_for(std::size_t{0}, texture_groups_.size(),
                    [&](std::size_t i) { texture_groups_[i].pyramid = build_pyramid(texture_groups_[i]); });
  build_materials();
  tbb::parallel_for(std::size_t{0}, texture_groups_.size(),
                    [&](std::size_t i) { compute_triangle_shading(texture_groups_[i]); });
}

void PartAppearance::group_meshes_by_texture() {
  for (std::size_t i = 0; i < meshes_->size(); ++i) {
    const TexturedMesh& mesh = (*meshes_)[i];
    if (!has_texture(mesh)) continue;
    const std::size_t index = group_of_texture_.emplace(mesh.texture.get(), texture_groups_.size()).first->second;
    if (index == texture_groups_.size()) texture_groups_.emplace_back();
    texture_groups_[index].meshes.push_back(static_cast<std::uint32_t>(i));
  }
}

std::shared_ptr<const MipPyramid> PartAppearance::build_pyramid(const TextureGroup& skin) const {
  std::vector<const TexturedMesh*> users;
  for (const std::uint32_t mesh : skin.meshes) users.push_back(&(*meshes_)[mesh]);
  return std::make_shared<const MipPyramid>(users[0]->texture, texture_coverage(users));
}

void PartAppearance::build_materials() {
  std::size_t first = 0;
  for (const TexturedMesh& mesh : *meshes_) {
    const MipPyramid* pyramid =
        has_texture(mesh) ? texture_groups_[group_of_texture_.at(mesh.texture.get())].pyramid.get() : nullptr;
    materials_.push_back(material_of(mesh, pyramid));
    materials_.back().triangles = triangles_.data() + first;
    first_triangle_.push_back(first);
    first += mesh.mesh.triangles.size();
  }
}

/// Computes the shading data of all triangles in the group's meshes.
void PartAppearance::compute_triangle_shading(const TextureGroup& skin) {
  const int coarsest = skin.pyramid->levels() - 1;
  for (const std::uint32_t i : skin.meshes) {
    const TexturedMesh& mesh = (*meshes_)[i];
    const std::vector<std::int32_t> levels = chart_max_mip_levels(mesh);
    TriangleShading* out = triangles_.data() + first_triangle_[i];
    for (std::size_t t = 0; t < levels.size(); ++t)
      out[t] = shade_of(mesh, mesh.mesh.triangles[t], std::min(levels[t], coarsest));
  }
}

Appearance::Appearance(std::vector<std::shared_ptr<const PartAppearance>> parts) : parts_(std::move(parts)) {
  for (const auto& part : parts_)
    materials_.insert(materials_.end(), part->materials().begin(), part->materials().end());
}

Appearance::Appearance(const scene::Scene& scene) : Appearance(appearances_of(scene)) {}

}  // namespace tileflight::render
