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

}  // namespace

Appearance::Appearance(const scene::Scene& scene) {
  build_pyramids(scene);
  build_materials(scene);
}

void Appearance::build_pyramids(const scene::Scene& scene) {
  const std::vector<TexturedMesh>& meshes = scene.meshes();
  std::unordered_map<const imaging::RgbImage*, std::size_t> index_of;
  std::vector<std::vector<const TexturedMesh*>> users;  // of each texture
  for (const TexturedMesh& mesh : meshes) {
    if (!textured(mesh)) continue;
    const std::size_t index = index_of.emplace(mesh.texture.get(), users.size()).first->second;
    if (index == users.size()) users.emplace_back();
    users[index].push_back(&mesh);
  }
  pyramids_.resize(users.size());
  tbb::parallel_for(std::size_t{0}, users.size(), [&](std::size_t i) {
    pyramids_[i] = std::make_unique<MipPyramid>(users[i][0]->texture, texture_coverage(users[i]));
  });
  for (const TexturedMesh& mesh : meshes) {
    pyramid_of_mesh_.push_back(textured(mesh) ? pyramids_[index_of.at(mesh.texture.get())].get() : nullptr);
  }
}

void Appearance::build_materials(const scene::Scene& scene) {
  const std::vector<TexturedMesh>& meshes = scene.meshes();
  triangles_.resize(scene.triangle_count());
  std::size_t first = 0;
  for (std::size_t i = 0; i < meshes.size(); ++i) {
    materials_.push_back(material_of(meshes[i], pyramid_of_mesh_[i]));
    materials_.back().first_triangle = first;
    first += meshes[i].mesh.triangles.size();
  }
  tbb::parallel_for(std::size_t{0}, meshes.size(), [&](std::size_t i) {
    const TexturedMesh& mesh = meshes[i];
    if (!textured(mesh)) return;
    const int coarsest = pyramid_of_mesh_[i]->levels() - 1;
    const std::vector<std::int32_t> levels = chart_levels(mesh);
    TriangleShade* out = triangles_.data() + materials_[i].first_triangle;
    for (std::size_t t = 0; t < levels.size(); ++t) {
      out[t] = shade_of(mesh, mesh.mesh.triangles[t], std::min(levels[t], coarsest));
    }
  });
}

}  // namespace tileflight::sensors
