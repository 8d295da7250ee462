#include "tileflight/capture/render/appearance.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <numeric>
#include <unordered_map>
#include <utility>

namespace tileflight::render {

std::uintmax_t decoded_bytes(const imaging::TexturedMesh& mesh) {
  return imaging::vertex_bytes(mesh) + mesh.mesh.triangles.size() * sizeof(mesh.mesh.triangles[0]);
}

std::uintmax_t rendered_bytes(const imaging::TexturedMesh& mesh) {
  constexpr std::uintmax_t kTreeBytes = 180;  // per triangle: both trees, with their copies of its corners
  return decoded_bytes(mesh) + mesh.mesh.triangles.size() * (kTreeBytes + sizeof(TriangleShading));
}

std::uintmax_t rendered_bytes(const imaging::RgbImage& texture) {
  return texture.pixels.size() * sizeof(imaging::Rgb8) * 7 / 3;  // image, copy, and a third of it
}

namespace {

using imaging::TexturedMesh;
using Corners = std::array<Eigen::Vector2f, 3>;  // texels

Corners texel_corners(const TexturedMesh& mesh, const geometry::Triangle& t) {
  const Eigen::Vector2f size(static_cast<float>(mesh.texture->width), static_cast<float>(mesh.texture->height));
  return {mesh.uv[t[0]].cwiseProduct(size), mesh.uv[t[1]].cwiseProduct(size), mesh.uv[t[2]].cwiseProduct(size)};
}

struct Interval {
  float low = std::numeric_limits<float>::infinity();
  float high = -std::numeric_limits<float>::infinity();

  void add(float x) {
    low = std::min(low, x);
    high = std::max(high, x);
  }
};

/// The x range of the triangle within the band y0 <= y <= y0 + 1.
Interval span_in_band(const Corners& p, float y0) {
  Interval span;
  const float y1 = y0 + 1.0F;
  for (std::size_t i = 0; i < 3; ++i) {
    const Eigen::Vector2f& a = p[i];
    const Eigen::Vector2f& b = p[(i + 1) % 3];
    if (a.y() >= y0 && a.y() <= y1) span.add(a.x());
    for (const float y : {y0, y1}) {
      if ((a.y() < y) == (b.y() < y)) continue;
      span.add(a.x() + (y - a.y()) / (b.y() - a.y()) * (b.x() - a.x()));
    }
  }
  return span;
}

/// Texel indices from `low` to `high`; a texel that is only touched at its border does not count.
std::pair<int, int> texels_within(float low, float high, int size) {
  constexpr float kRim = 0.01F;
  const int first = std::clamp(static_cast<int>(low + kRim), 0, size - 1);
  const int last = std::clamp(static_cast<int>(high - kRim), first, size - 1);
  return {first, last};
}

void mark_triangle(const Corners& p, imaging::GrayImage& coverage) {
  const auto [low, high] = std::minmax({p[0].y(), p[1].y(), p[2].y()});
  const auto [top, bottom] = texels_within(low, high, coverage.height);
  for (int y = top; y <= bottom; ++y) {
    const Interval span = span_in_band(p, static_cast<float>(y));
    if (!(span.low <= span.high)) continue;
    const auto [left, right] = texels_within(span.low, span.high, coverage.width);
    std::fill(coverage.row(y) + left, coverage.row(y) + right + 1, std::uint8_t{255});
  }
}

/// Disjoint sets of vertices (Tarjan 1975), with path halving.
class VertexSets {
 public:
  explicit VertexSets(std::size_t count) : parent_(count) { std::iota(parent_.begin(), parent_.end(), 0U); }
  std::uint32_t find(std::uint32_t i) {
    while (parent_[i] != i) {
      parent_[i] = parent_[parent_[i]];
      i = parent_[i];
    }
    return i;
  }
  void join(std::uint32_t a, std::uint32_t b) { parent_[find(a)] = find(b); }

 private:
  std::vector<std::uint32_t> parent_;
};

/// Vertices in one set if connected by triangles or equal texture coordinates.
VertexSets joined_vertices(const TexturedMesh& mesh) {
  VertexSets sets(mesh.uv.size());
  std::unordered_map<std::uint64_t, std::uint32_t> first_at;
  first_at.reserve(mesh.uv.size());
  for (std::uint32_t i = 0; i < mesh.uv.size(); ++i) {
    const std::uint64_t key = std::uint64_t{std::bit_cast<std::uint32_t>(mesh.uv[i].x())} << 32U |
                              std::bit_cast<std::uint32_t>(mesh.uv[i].y());
    const auto [entry, fresh] = first_at.emplace(key, i);
    if (!fresh) sets.join(i, entry->second);
  }
  for (const geometry::Triangle& t : mesh.mesh.triangles) {
    sets.join(t[0], t[1]);
    sets.join(t[0], t[2]);
  }
  return sets;
}

struct Chart {
  Interval x, y;
  float area = 0.0F;  // texels

  void add(const Corners& p) {
    for (const Eigen::Vector2f& corner : p) {
      x.add(corner.x());
      y.add(corner.y());
    }
    const Eigen::Vector2f a = p[1] - p[0];
    const Eigen::Vector2f b = p[2] - p[0];
    area += 0.5F * std::abs(a.x() * b.y() - a.y() * b.x());
  }
  /// Area divided by length; also valid for a diagonal strip.
  float width() const { return area / std::max({1.0F, x.high - x.low, y.high - y.low}); }
};

}  // namespace

bool within_image(const TexturedMesh& mesh) {
  constexpr float kSlack = 1e-3F;
  return std::ranges::all_of(
      mesh.uv, [](const Eigen::Vector2f& uv) { return uv.minCoeff() >= -kSlack && uv.maxCoeff() <= 1.0F + kSlack; });
}

imaging::GrayImage texture_coverage(std::span<const TexturedMesh* const> meshes) {
  if (meshes.empty() || !std::ranges::all_of(meshes, [](const auto* mesh) { return within_image(*mesh); })) return {};
  imaging::GrayImage coverage(meshes[0]->texture->width, meshes[0]->texture->height);
  for (const TexturedMesh* mesh : meshes) {
    for (const geometry::Triangle& t : mesh->mesh.triangles) mark_triangle(texel_corners(*mesh, t), coverage);
  }
  const bool whole = std::memchr(coverage.pixels.data(), 0, coverage.pixels.size()) == nullptr;
  return whole ? imaging::GrayImage{} : coverage;
}

std::vector<std::int32_t> chart_max_mip_levels(const TexturedMesh& mesh) {
  VertexSets sets = joined_vertices(mesh);
  std::vector<Chart> charts(mesh.uv.size());  // indexed by the set's representative vertex
  for (const geometry::Triangle& t : mesh.mesh.triangles) charts[sets.find(t[0])].add(texel_corners(mesh, t));
  std::vector<std::int32_t> levels;
  levels.reserve(mesh.mesh.triangles.size());
  for (const geometry::Triangle& t : mesh.mesh.triangles) {
    const float width = std::max(1.0F, charts[sets.find(t[0])].width());
    levels.push_back(static_cast<std::int32_t>(std::ceil(std::log2(std::min(width, 1e6F)))));
  }
  return levels;
}

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

Material material_of(const TexturedMesh& mesh, const MipPyramid* pyramid, const MipPyramid* opacity) {
  Material material;
  material.texture_only = is_plain(mesh);
  material.factor = {mesh.base_color[0], mesh.base_color[1], mesh.base_color[2]};
  if (!mesh.colors.empty()) material.vertex_colors = mesh.colors.data();
  material.blends = mesh.blends;
  material.opacity = std::clamp(mesh.base_color[3], 0.0F, 1.0F);
  if (mesh.opacity) material.opacity_texture = opacity;
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
  for (TextureGroup& skin : texture_groups_) {
    skin.pyramid = make_pyramid(skin, (*meshes_)[skin.meshes[0]].texture);
    if (skin.opacity_image) skin.opacity = make_pyramid(skin, skin.opacity_image);
  }
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
    if (mesh.opacity) texture_groups_[index].opacity_image = mesh.opacity;
  }
}

std::shared_ptr<const MipPyramid> PartAppearance::make_pyramid(const TextureGroup& skin,
                                                               std::shared_ptr<const imaging::RgbImage> image) const {
  const auto coverage = [meshes = meshes_, numbers = skin.meshes] {
    std::vector<const TexturedMesh*> users;
    for (const std::uint32_t mesh : numbers) users.push_back(&(*meshes)[mesh]);
    return texture_coverage(users);
  };
  return std::make_shared<const MipPyramid>(std::move(image), coverage);
}

void PartAppearance::build_pyramids() const {
  tbb::parallel_for(std::size_t{0}, texture_groups_.size(), [&](std::size_t i) {
    texture_groups_[i].pyramid->build();
    if (texture_groups_[i].opacity) texture_groups_[i].opacity->build();
  });
}

void PartAppearance::build_materials() {
  std::size_t first = 0;
  for (const TexturedMesh& mesh : *meshes_) {
    const TextureGroup* skin = has_texture(mesh) ? &texture_groups_[group_of_texture_.at(mesh.texture.get())] : nullptr;
    materials_.push_back(skin != nullptr ? material_of(mesh, skin->pyramid.get(), skin->opacity.get())
                                         : material_of(mesh, nullptr, nullptr));
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
  has_blending_ = std::ranges::any_of(materials_, &Material::blends);
}

Appearance::Appearance(const scene::Scene& scene) : Appearance(appearances_of(scene)) {}

}  // namespace tileflight::render
