#include "tileflight/sensors/block_tracer.h"

#include <algorithm>
#include <cmath>

#include "tileflight/sensors/light.h"

namespace tileflight::sensors {
namespace {

using scene::RayPacket8;

void rotate_row(const RayBlock& rays, int row, const TracerPose& pose, RayPacket8& packet) {
  const std::array<float, 9>& r = pose.rotation;
  for (int i = row * RayBlock::kColumns; i < (row + 1) * RayBlock::kColumns; ++i) {
    packet.origin_x[i] = pose.origin[0];
    packet.origin_y[i] = pose.origin[1];
    packet.origin_z[i] = pose.origin[2];
    packet.direction_x[i] = r[0] * rays.x[i] + r[1] * rays.y[i] + r[2] * rays.z[i];
    packet.direction_y[i] = r[3] * rays.x[i] + r[4] * rays.y[i] + r[5] * rays.z[i];
    packet.direction_z[i] = r[6] * rays.x[i] + r[7] * rays.y[i] + r[8] * rays.z[i];
  }
}

struct Vec3f {
  float x, y, z;
};
float dot(const Vec3f& a, const Vec3f& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
float dot(const std::array<float, 3>& a, const Vec3f& b) { return a[0] * b.x + a[1] * b.y + a[2] * b.z; }

Vec3f difference(const RayPacket8& packet, int to, int from) {
  return {packet.direction_x[to] - packet.direction_x[from], packet.direction_y[to] - packet.direction_y[from],
          packet.direction_z[to] - packet.direction_z[from]};
}

/// Ray differentials (Igehy, SIGGRAPH 1999): a ray turned by dD meets the hit triangle's plane (normal N) moved by
/// dP = t (dD - D (dD . N) / (D . N)); the texture moves by its gradient along dP. dD is the step to the neighbouring
/// lane.
TexelGradient texel_gradient(const RayPacket8& packet, int lane, const TriangleShade& shade) {
  const int column = lane % RayBlock::kColumns;
  const int across = column + 1 < RayBlock::kColumns ? lane : lane - 1;
  const Vec3f d_x = difference(packet, across + 1, across);
  const Vec3f d_y = difference(packet, RayBlock::kColumns + column, column);
  const Vec3f direction{packet.direction_x[lane], packet.direction_y[lane], packet.direction_z[lane]};
  const Vec3f normal{packet.normal_x[lane], packet.normal_y[lane], packet.normal_z[lane]};
  const float t = packet.far[lane];
  const float slope = dot(normal, direction);
  const float lean = 1.0F / (std::abs(slope) > 1e-30F ? slope : 1e-30F);
  const auto towards = [&](const std::array<float, 3>& gradient) {
    const float along = dot(gradient, direction) * lean;
    return Vec3f{t * (gradient[0] - along * normal.x), t * (gradient[1] - along * normal.y),
                 t * (gradient[2] - along * normal.z)};
  };
  const Vec3f g_s = towards(shade.texel_s);
  const Vec3f g_t = towards(shade.texel_t);
  return {dot(g_s, d_x), dot(g_t, d_x), dot(g_s, d_y), dot(g_t, d_y)};
}

/// glTF vertex colours at the hit: linear, interpolated over the triangle.
Light vertex_colour(const imaging::TexturedMesh& mesh, std::uint32_t triangle, float u, float v) {
  const geometry::Triangle& t = mesh.mesh.triangles[triangle];
  Light light;
  for (std::size_t c = 0; c < 3; ++c) {
    const auto value = [&](int corner) { return static_cast<float>(mesh.colors[t[corner]][c]) * (1.0F / 255.0F); };
    light[c] = (1.0F - u - v) * value(0) + u * value(1) + v * value(2);
  }
  return light;
}

}  // namespace

TracerPose::TracerPose(const geometry::SE3& T_local_camera, const geometry::Vec3& anchor) {
  const geometry::Mat3 r = T_local_camera.rotation.toRotationMatrix();
  const geometry::Vec3 relative = T_local_camera.translation - anchor;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) rotation[static_cast<std::size_t>(3 * i + j)] = static_cast<float>(r(i, j));
    origin[static_cast<std::size_t>(i)] = static_cast<float>(relative[i]);
  }
}

BlockTracer::BlockTracer(const scene::Scene& scene, const Appearance& appearance, const imaging::Rgb8& background)
    : scene_(scene), appearance_(appearance) {
  for (int c = 0; c < 3; ++c) {
    background_squares_[c] = static_cast<float>(background[static_cast<std::size_t>(c)]) *
                             static_cast<float>(background[static_cast<std::size_t>(c)]);
  }
  background_squares_[3] = 0.0F;
}

void BlockTracer::cast(const RayBlock& rays, std::uint8_t valid, const TracerPose& upper, const TracerPose& lower,
                       RayPacket8& packet) const {
  packet.reset();
  rotate_row(rays, 0, upper, packet);
  rotate_row(rays, 1, lower, packet);
  if (valid != 0xFF) {
    for (int i = 0; i < RayPacket8::kLanes; ++i) {
      if ((valid >> i & 1) == 0) packet.switch_off(i);
    }
  }
  scene_.intersect(packet);
}

void BlockTracer::shade(std::uint8_t valid, TracedBlock& block) const {
  for (int i = 0; i < RayPacket8::kLanes; ++i) {
    if ((valid >> i & 1) != 0) block.squares[static_cast<std::size_t>(i)] = shade_lane(block.packet, i);
  }
}

Float4 BlockTracer::shade_lane(const RayPacket8& packet, int lane) const {
  const std::uint32_t mesh = packet.mesh[lane];
  if (mesh == RayPacket8::kMiss) return background_squares_;
  const Material& material = appearance_.material(mesh);
  return material.plain ? shade_plain(material, packet, lane) : shade_tinted(material, packet, lane);
}

Float4 BlockTracer::shade_plain(const Material& material, const RayPacket8& packet, int lane) const {
  const TriangleShade& shade = appearance_.shade(material, packet.triangle[lane]);
  const float u = packet.u[lane];
  const float v = packet.v[lane];
  const float s = shade.s + u * shade.s_u + v * shade.s_v;
  const float t = shade.t + u * shade.t_u + v * shade.t_v;
  const TexelGradient gradient = texel_gradient(packet, lane, shade);
  return sample_squares(material.texture, s, t, footprint_of(material.texture, gradient, shade.max_level));
}

Float4 BlockTracer::shade_tinted(const Material& material, const RayPacket8& packet, int lane) const {
  const SrgbTables& srgb = SrgbTables::get();
  Light light = material.factor;
  if (material.texture.pyramid != nullptr) {
    const Float4 squares = shade_plain(material, packet, lane);
    for (int c = 0; c < 3; ++c) light[static_cast<std::size_t>(c)] *= srgb.decode(std::sqrt(squares[c]));
  }
  if (material.colors != nullptr) {
    const imaging::TexturedMesh& mesh = scene_.meshes()[packet.mesh[lane]];
    const Light colour = vertex_colour(mesh, packet.triangle[lane], packet.u[lane], packet.v[lane]);
    for (std::size_t c = 0; c < 3; ++c) light[c] *= colour[c];
  }
  Float4 squares{};
  for (int c = 0; c < 3; ++c) {
    const float value = srgb.encode(light[static_cast<std::size_t>(c)]);
    squares[c] = value * value;
  }
  return squares;
}

}  // namespace tileflight::sensors
