#include "tileflight/capture/render/surface_color.h"

#include <algorithm>
#include <cmath>

namespace tileflight::render {

double Reflectance::at(const scene::Hit& hit, double footprint_m) const {
  const LinearRgb light = surface_color(scene_, appearance_, hit, footprint_m);
  return std::clamp(0.2126 * light[0] + 0.7152 * light[1] + 0.0722 * light[2], 0.0, 1.0);
}

namespace {

/// The mip level whose texel has the width of the footprint (footprint.h).
float level_of(const TriangleShading& shade, double footprint_m) {
  const auto steep = [](const std::array<float, 3>& gradient) {
    return std::hypot(gradient[0], gradient[1], gradient[2]);
  };
  const double texels = footprint_m * std::max(steep(shade.texel_s), steep(shade.texel_t));
  return std::clamp(static_cast<float>(std::log2(std::max(1.0, texels))), 0.0F, static_cast<float>(shade.max_level));
}

LinearRgb sample_texture(const Texture& texture, const TriangleShading& shade, const scene::Hit& hit,
                         double footprint_m) {
  const SrgbTables& srgb = SrgbTables::get();
  TextureRead read;
  read.s = shade.s + hit.u * shade.s_u + hit.v * shade.s_v;
  read.t = shade.t + hit.u * shade.t_u + hit.v * shade.t_v;
  read.lod = std::min(level_of(shade, footprint_m), static_cast<float>(texture.pyramid->levels() - 1));
  const Float4 squares = sample_squares(texture, read);
  return {srgb.decode(std::sqrt(squares[0])), srgb.decode(std::sqrt(squares[1])), srgb.decode(std::sqrt(squares[2]))};
}

/// Linear vertex colours (glTF), interpolated over the triangle.
std::array<float, 4> interpolate_vertex_colors(const imaging::TexturedMesh& mesh, const scene::Hit& hit) {
  const geometry::Triangle& corners = mesh.mesh.triangles[hit.triangle];
  const std::array<float, 3> weights{1.0F - hit.u - hit.v, hit.u, hit.v};
  std::array<float, 4> light{};
  for (std::size_t corner = 0; corner < 3; ++corner) {
    for (std::size_t c = 0; c < 4; ++c)
      light[c] += weights[corner] / 255.0F * static_cast<float>(mesh.colors[corners[corner]][c]);
  }
  return light;
}

/// Texture gradients are by metres of the part; of a placed part that is scaled these are others than the scene's.
double footprint_in_part_m(const scene::Scene& scene, const scene::Hit& hit, double footprint_m) {
  if (hit.mesh < scene.first_placed_mesh()) return footprint_m;
  const Eigen::Affine3d pose = scene.placed_pose(scene.placed_of_mesh(hit.mesh), hit.time);
  return footprint_m / std::cbrt(pose.linear().determinant());
}

}  // namespace

LinearRgb surface_color(const scene::Scene& scene, const Appearance& appearance, const scene::Hit& hit,
                        double footprint_m) {
  const Material& material = appearance.material(hit.mesh);
  LinearRgb light = material.factor;
  const auto multiply = [&light](const auto& by) {
    for (std::size_t c = 0; c < 3; ++c) light[c] *= by[c];
  };
  if (material.texture.pyramid != nullptr) {
    multiply(sample_texture(material.texture, appearance.triangle_shading(material, hit.triangle), hit,
                            footprint_in_part_m(scene, hit, footprint_m)));
  }
  if (material.vertex_colors != nullptr) multiply(interpolate_vertex_colors(scene.meshes()[hit.mesh], hit));
  return light;
}

float surface_opacity(const scene::Scene& scene, const Appearance& appearance, const scene::Hit& hit,
                      double footprint_m) {
  const Material& material = appearance.material(hit.mesh);
  if (!material.blends) return 1.0F;
  float opacity = material.opacity;
  if (material.opacity_texture != nullptr) {
    Texture texture = material.texture;
    texture.pyramid = material.opacity_texture;
    opacity *= sample_texture(texture, appearance.triangle_shading(material, hit.triangle), hit,
                              footprint_in_part_m(scene, hit, footprint_m))[0];
  }
  if (material.vertex_colors != nullptr) opacity *= interpolate_vertex_colors(scene.meshes()[hit.mesh], hit)[3];
  return opacity;
}

}  // namespace tileflight::render
