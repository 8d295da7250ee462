#include "tileflight/sensors/surface_color.h"

#include <algorithm>
#include <cmath>

namespace tileflight::sensors {
namespace {

/// The mip level whose texel is as wide as the footprint (footprint.h).
float level_of(const TriangleShade& shade, double footprint_m) {
  const auto steep = [](const std::array<float, 3>& gradient) {
    return std::hypot(gradient[0], gradient[1], gradient[2]);
  };
  const double texels = footprint_m * std::max(steep(shade.texel_s), steep(shade.texel_t));
  return std::clamp(static_cast<float>(std::log2(std::max(1.0, texels))), 0.0F, static_cast<float>(shade.max_level));
}

Light textured(const Material& material, const TriangleShade& shade, const scene::Hit& hit, double footprint_m) {
  const SrgbTables& srgb = SrgbTables::get();
  TextureRead read;
  read.s = shade.s + hit.u * shade.s_u + hit.v * shade.s_v;
  read.t = shade.t + hit.u * shade.t_u + hit.v * shade.t_v;
  read.lod = level_of(shade, footprint_m);
  const Float4 squares = sample_squares(material.texture, read);
  return {srgb.decode(std::sqrt(squares[0])), srgb.decode(std::sqrt(squares[1])), srgb.decode(std::sqrt(squares[2]))};
}

/// Of the vertices, linear (glTF), over the triangle.
Light coloured(const imaging::TexturedMesh& mesh, const scene::Hit& hit) {
  const geometry::Triangle& corners = mesh.mesh.triangles[hit.triangle];
  const std::array<float, 3> weights{1.0F - hit.u - hit.v, hit.u, hit.v};
  Light light{};
  for (std::size_t corner = 0; corner < 3; ++corner) {
    for (std::size_t c = 0; c < 3; ++c)
      light[c] += weights[corner] / 255.0F * static_cast<float>(mesh.colors[corners[corner]][c]);
  }
  return light;
}

}  // namespace

Light surface_color(const scene::Scene& scene, const Appearance& appearance, const scene::Hit& hit,
                    double footprint_m) {
  const Material& material = appearance.material(hit.mesh);
  Light light = material.factor;
  const auto multiply = [&light](const Light& by) {
    for (std::size_t c = 0; c < 3; ++c) light[c] *= by[c];
  };
  if (material.texture.pyramid != nullptr)
    multiply(textured(material, appearance.shade(material, hit.triangle), hit, footprint_m));
  if (material.colors != nullptr) multiply(coloured(scene.meshes()[hit.mesh], hit));
  return light;
}

}  // namespace tileflight::sensors
