#include "tileflight/capture/render/texture_atlas.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <numeric>
#include <unordered_map>
#include <utility>

namespace tileflight::render {
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
  const bool whole = std::ranges::all_of(coverage.pixels, [](std::uint8_t texel) { return texel != 0; });
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

}  // namespace tileflight::render
