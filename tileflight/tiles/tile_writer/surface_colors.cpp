#include "tileflight/tiles/tile_writer/surface_colors.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "tileflight/core/base/srgb.h"
#include "tileflight/tiles/mesh_files/texel_window.h"

namespace tileflight::tile_writer {
namespace {

using geometry::Triangle;
using geometry::Vec3;
using imaging::TexturedMesh;

geometry::TriangleMesh joined(const std::vector<const TexturedMesh*>& meshes) {
  geometry::TriangleMesh out;
  for (const TexturedMesh* m : meshes) {
    const auto first = static_cast<std::uint32_t>(out.vertices.size());
    out.vertices.insert(out.vertices.end(), m->mesh.vertices.begin(), m->mesh.vertices.end());
    for (const Triangle& t : m->mesh.triangles) out.triangles.push_back({first + t[0], first + t[1], first + t[2]});
  }
  return out;
}

/// Barycentric weights of a point of a triangle, by areas; for a degenerate triangle, its first corner.
std::array<double, 3> weights_at(const Vec3& p, const Vec3& a, const Vec3& b, const Vec3& c) {
  const Vec3 normal = (b - a).cross(c - a);
  const double area2 = normal.squaredNorm();
  if (!(area2 > 0)) return {1, 0, 0};
  const double wb = std::clamp((p - a).cross(c - a).dot(normal) / area2, 0.0, 1.0);
  const double wc = std::clamp((b - a).cross(p - a).dot(normal) / area2, 0.0, 1.0 - wb);
  return {1 - wb - wc, wb, wc};
}

using TextureColor = std::array<double, 3>;  ///< sRGB, 0..255

/// Bilinear interpolation at (x, y) in texels.
TextureColor bilinear(const TexturedMesh& mesh, double x, double y) {
  const double left = std::floor(x - 0.5), top = std::floor(y - 0.5);
  const double across = x - 0.5 - left, down = y - 0.5 - top;
  const auto column = static_cast<std::int64_t>(left), row = static_cast<std::int64_t>(top);
  const std::array texels{mesh_files::wrapped_texel(mesh, column, row), mesh_files::wrapped_texel(mesh, column + 1, row),
                          mesh_files::wrapped_texel(mesh, column, row + 1), mesh_files::wrapped_texel(mesh, column + 1, row + 1)};
  const std::array weights{(1 - across) * (1 - down), across * (1 - down), (1 - across) * down, across * down};
  TextureColor out{};
  for (std::size_t k = 0; k < 4; ++k)
    for (std::size_t c = 0; c < 3; ++c) out[c] += weights[k] * texels[k][c];
  return out;
}

/// The texture at half resolution: a mean over two texels across and down.
TextureColor texture_color(const TexturedMesh& mesh, const Triangle& t, const std::array<double, 3>& weights) {
  Eigen::Vector2d uv = Eigen::Vector2d::Zero();
  for (std::size_t k = 0; k < 3; ++k) uv += weights[k] * mesh.uv[t[k]].cast<double>();
  constexpr double kFar = 1e8;
  const double x = std::clamp(uv.x() * mesh.texture->width, -kFar, kFar);
  const double y = std::clamp(uv.y() * mesh.texture->height, -kFar, kFar);
  TextureColor out{};
  for (const double dx : {-0.5, 0.5})
    for (const double dy : {-0.5, 0.5}) {
      const TextureColor tap = bilinear(mesh, x + dx, y + dy);
      for (std::size_t c = 0; c < 3; ++c) out[c] += tap[c] / 4;
    }
  return out;
}

/// Multiplies by vertex and base colours in linear light.
void tint(const TexturedMesh& mesh, const Triangle& t, const std::array<double, 3>& weights, TextureColor& color) {
  for (std::size_t c = 0; c < 3; ++c) {
    double factor = static_cast<double>(mesh.base_color[c]);
    if (!mesh.colors.empty()) {
      double own = 0;
      for (std::size_t k = 0; k < 3; ++k) own += weights[k] * mesh.colors[t[k]][c];
      factor *= own / 255;
    }
    if (factor == 1.0) continue;
    const float linear = base::linear_from_srgb(static_cast<float>(color[c] / 255)) * static_cast<float>(factor);
    color[c] = 255.0 * static_cast<double>(base::srgb_from_linear(std::clamp(linear, 0.0F, 1.0F)));
  }
}

}  // namespace

SurfaceColors::SurfaceColors(std::vector<const TexturedMesh*> meshes)
    : meshes_(std::move(meshes)), numbering_(meshes_), index_(joined(meshes_)) {}

double SurfaceColors::distance_m(std::uint32_t number, const Vec3& place) const {
  const TriangleNumbering::TriangleRef at = numbering_(number);
  const auto& v = meshes_[at.mesh]->mesh.vertices;
  const Triangle& t = meshes_[at.mesh]->mesh.triangles[at.triangle];
  return (place - geometry::closest_point_on_triangle(place, v[t[0]], v[t[1]], v[t[2]])).norm();
}

imaging::Rgb8 SurfaceColors::color(std::uint32_t number, const Vec3& on_surface) const {
  const TriangleNumbering::TriangleRef at = numbering_(number);
  const TexturedMesh& mesh = *meshes_[at.mesh];
  const Triangle& t = mesh.mesh.triangles[at.triangle];
  const auto& v = mesh.mesh.vertices;
  const std::array<double, 3> weights = weights_at(on_surface, v[t[0]], v[t[1]], v[t[2]]);
  TextureColor color{255, 255, 255};
  if (mesh.texture && !mesh.uv.empty()) color = texture_color(mesh, t, weights);
  tint(mesh, t, weights, color);
  imaging::Rgb8 out{};
  for (std::size_t c = 0; c < 3; ++c) out[c] = static_cast<std::uint8_t>(std::clamp(color[c] + 0.5, 0.0, 255.0));
  return out;
}

imaging::Rgb8 SurfaceColors::CoherentSampler::at(const Vec3& place) {
  // Slightly more than the distance to some triangle: the nearest one is always within it.
  const double radius_m =
      has_last_ ? colors_.distance_m(last_, place) * (1 + 1e-6) + 1e-9 : std::numeric_limits<double>::infinity();
  const geometry::SurfacePoint nearest = *colors_.index_.nearest(place, radius_m);
  has_last_ = true;
  last_ = static_cast<std::uint32_t>(nearest.triangle);
  return colors_.color(last_, nearest.position);
}

}  // namespace tileflight::tile_writer
