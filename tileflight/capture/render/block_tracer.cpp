#include "tileflight/capture/render/block_tracer.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "tileflight/capture/render/footprint.h"
#include "tileflight/capture/render/linear_color.h"
#include "tileflight/core/base/simd.h"
#include "tileflight/world/scene/beam_tree.h"

namespace tileflight::render {
namespace {

using scene::RayPacket8;

/// Rotates the rays of a block's rows `from` on, whose lanes are those of `Lanes` from its first on.
template <class Lanes>
TILEFLIGHT_LANE_INLINE void rotate_lanes(const RayBlock& rays, int from, const TracerPose& pose, RayPacket8& packet) {
  const auto put = [&](const Lanes& lanes, float(&to)[RayPacket8::kLanes]) {
    std::memcpy(to + from, &lanes, sizeof(lanes));
  };
  Lanes x, y, z;
  std::memcpy(&x, rays.x + from, sizeof(x));
  std::memcpy(&y, rays.y + from, sizeof(y));
  std::memcpy(&z, rays.z + from, sizeof(z));
  const std::array<float, 9>& r = pose.rotation;
  put(r[0] * x + r[1] * y + r[2] * z, packet.direction_x);
  put(r[3] * x + r[4] * y + r[5] * z, packet.direction_y);
  put(r[6] * x + r[7] * y + r[8] * z, packet.direction_z);
  put(Lanes{} + pose.origin[0], packet.origin_x);
  put(Lanes{} + pose.origin[1], packet.origin_y);
  put(Lanes{} + pose.origin[2], packet.origin_z);
  put(Lanes{} + pose.scene_time, packet.time);
}

TILEFLIGHT_LANE_INLINE void fill_packet(const RayBlock& rays, std::uint8_t valid, const TracerPose& upper,
                                        const TracerPose& lower, RayPacket8& packet) {
  packet.reset();
  if (&upper == &lower) {
    rotate_lanes<Float8>(rays, 0, upper, packet);
  } else {
    rotate_lanes<Float4>(rays, 0, upper, packet);
    rotate_lanes<Float4>(rays, RayBlock::kColumns, lower, packet);
  }
  if (valid == 0xFF) return;
  for (int i = 0; i < RayPacket8::kLanes; ++i) {
    if ((valid >> i & 1) == 0) packet.disable_lane(i);
  }
}

TILEFLIGHT_LANE_INLINE void collect_blocks(const RayTable& table, int x, int y, TracedBeam& beam) {
  const int right = std::min((x + TracedBeam::kColumns) / RayBlock::kColumns, table.block_columns());
  const int bottom = std::min((y + TracedBeam::kRows) / RayBlock::kRows, table.block_rows());
  beam.size = 0;
  for (int row = y / RayBlock::kRows; row < bottom; ++row) {
    for (int column = x / RayBlock::kColumns; column < right; ++column) {
      const std::uint8_t valid = table.valid(column, row);
      if (valid != 0) beam.blocks[beam.size++] = {column, row, valid};
    }
  }
}

/// Shading data of the hits; `material` is null in lanes without a hit.
struct LaneTextures {
  const Material* material[RayPacket8::kLanes];
  const TriangleShading* shade[RayPacket8::kLanes];  ///< never null: lanes without texture point to an empty one
};

const TriangleShading kNoTexture{};

TILEFLIGHT_LANE_INLINE void find_textures(const RayPacket8& packet, const Appearance& appearance, LaneTextures& lanes) {
  for (int i = 0; i < RayPacket8::kLanes; ++i) {
    lanes.material[i] = nullptr;
    lanes.shade[i] = &kNoTexture;
    if (packet.mesh[i] == RayPacket8::kMiss) continue;
    lanes.material[i] = &appearance.material(packet.mesh[i]);
    if (lanes.material[i]->texture.pyramid == nullptr) continue;
    lanes.shade[i] = &appearance.triangle_shading(*lanes.material[i], packet.triangle[i]);
  }
}

TILEFLIGHT_LANE_INLINE void gather_gradients(const LaneTextures& textures, TextureGradients8& lanes) {
  for (int i = 0; i < RayPacket8::kLanes; ++i) {
    const TriangleShading& shade = *textures.shade[i];
    const bool textured = &shade != &kNoTexture;
    lanes.s_x[i] = shade.texel_s[0];
    lanes.s_y[i] = shade.texel_s[1];
    lanes.s_z[i] = shade.texel_s[2];
    lanes.t_x[i] = shade.texel_t[0];
    lanes.t_y[i] = shade.texel_t[1];
    lanes.t_z[i] = shade.texel_t[2];
    lanes.width[i] = textured ? textures.material[i]->texture.width : 1.0F;
    lanes.height[i] = textured ? textures.material[i]->texture.height : 1.0F;
    lanes.max_level[i] = static_cast<float>(shade.max_level);
  }
}

/// Gradients of a placed part's textures are in its own frame: g_scene = M^-T g_part for points p_scene = M p_part + t.
void turn_gradients(const scene::Scene& scene, const RayPacket8& packet, const LaneTextures& textures,
                    TextureGradients8& lanes) {
  for (int i = 0; i < RayPacket8::kLanes; ++i) {
    if (textures.shade[i] == &kNoTexture || packet.mesh[i] < scene.first_placed_mesh()) continue;
    const Eigen::Affine3d pose =
        scene.placed_pose(scene.placed_of_mesh(packet.mesh[i]), static_cast<double>(packet.time[i]));
    const Eigen::Matrix3f turn = pose.linear().inverse().transpose().cast<float>();
    const Eigen::Vector3f s = turn * Eigen::Vector3f(lanes.s_x[i], lanes.s_y[i], lanes.s_z[i]);
    const Eigen::Vector3f t = turn * Eigen::Vector3f(lanes.t_x[i], lanes.t_y[i], lanes.t_z[i]);
    lanes.s_x[i] = s.x();
    lanes.s_y[i] = s.y();
    lanes.s_z[i] = s.z();
    lanes.t_x[i] = t.x();
    lanes.t_y[i] = t.y();
    lanes.t_z[i] = t.z();
  }
}

TILEFLIGHT_LANE_INLINE TextureRead read_of(const TriangleShading& shade, const RayPacket8& packet,
                                           const Footprints8& footprints, int lane) {
  const float u = packet.u[lane];
  const float v = packet.v[lane];
  return {shade.s + u * shade.s_u + v * shade.s_v,
          shade.t + u * shade.t_u + v * shade.t_v,
          footprints.step_s[lane],
          footprints.step_t[lane],
          static_cast<int>(footprints.probes[lane]),
          footprints.lod[lane]};
}

TILEFLIGHT_LANE_INLINE void prefetch_hits(const RayPacket8& packet, const Appearance& appearance) {
  for (int i = 0; i < RayPacket8::kLanes; ++i) {
    if (packet.mesh[i] == RayPacket8::kMiss) continue;
    __builtin_prefetch(&appearance.triangle_shading(appearance.material(packet.mesh[i]), packet.triangle[i]));
  }
}

/// A channel of glTF's vertex colours at the hit: linear, interpolated over the triangle.
float interpolate_colors(const imaging::TexturedMesh& mesh, std::uint32_t triangle, float u, float v,
                         std::size_t channel) {
  const geometry::Triangle& t = mesh.mesh.triangles[triangle];
  const auto value = [&](int corner) { return static_cast<float>(mesh.colors[t[corner]][channel]) * (1.0F / 255.0F); };
  return (1.0F - u - v) * value(0) + u * value(1) + v * value(2);
}

LinearRgb vertex_colour(const imaging::TexturedMesh& mesh, std::uint32_t triangle, float u, float v) {
  LinearRgb light;
  for (std::size_t c = 0; c < 3; ++c) light[c] = interpolate_colors(mesh, triangle, u, v, c);
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

std::vector<imaging::PixelRegion> tiles_of(const imaging::PixelRegion& region) {
  std::vector<imaging::PixelRegion> tiles;
  for (int y = region.y0; y < region.y1; y += kTileHeight) {
    for (int x = region.x0; x < region.x1; x += kTileWidth)
      tiles.push_back({x, y, std::min(region.x1, x + kTileWidth), std::min(region.y1, y + kTileHeight)});
  }
  return tiles;
}

static_assert(BlockTracer::kMostMoments == scene::kMostMovingBeams);

BlockTracer::BlockTracer(const scene::Scene& scene, const Appearance& appearance, const imaging::Rgb8& background,
                         double haze_per_m, const imaging::Rgb8& haze_color)
    : scene_(scene), appearance_(appearance), haze_per_m_(static_cast<float>(haze_per_m)) {
  for (std::size_t c = 0; c < 3; ++c) haze_[c] = SrgbTables::get().decode(haze_color[c]);
  for (int c = 0; c < 3; ++c) {
    background_squares_[c] = static_cast<float>(background[static_cast<std::size_t>(c)]) *
                             static_cast<float>(background[static_cast<std::size_t>(c)]);
  }
  background_squares_[3] = 0.0F;
}

namespace {

/// Prefetches the rays of the next beam on the right.
TILEFLIGHT_LANE_INLINE void prefetch_rays(const RayTable& table, int x, int y) {
  const int left = x / RayBlock::kColumns + TracedBeam::kColumns / RayBlock::kColumns;
  const int right = std::min(left + TracedBeam::kColumns / RayBlock::kColumns, table.block_columns());
  const int bottom = std::min((y + TracedBeam::kRows) / RayBlock::kRows, table.block_rows());
  if (left >= right) return;
  for (int row = y / RayBlock::kRows; row < bottom; ++row) {
    const auto* bytes = reinterpret_cast<const char*>(&table.block(left, row));
    const auto size = static_cast<int>(sizeof(RayBlock)) * (right - left);
    for (int line = 0; line < size; line += 64) __builtin_prefetch(bytes + line);
  }
}

/// Fills the beam's packets; returns those in use.
TILEFLIGHT_LANE_INLINE std::span<RayPacket8> fill_beam(const RayTable& table, int x, int y, const RowPoses& poses,
                                                       TracedBeam& beam) {
  collect_blocks(table, x, y, beam);
  prefetch_rays(table, x, y);
  const int n = table.samples_along_axis();
  for (int k = 0; k < beam.size; ++k) {
    const TracedBeam::Block& block = beam.blocks[k];
    const int row = block.row * RayBlock::kRows;
    fill_packet(table.block(block.column, block.row), block.valid, poses.at_row(row / n), poses.at_row((row + 1) / n),
                beam.packets[k]);
  }
  return std::span(beam.packets).first(static_cast<std::size_t>(beam.size));
}

}  // namespace

TILEFLIGHT_WIDE_VECTORS void BlockTracer::cast(const RayTable& table, int x, int y, const RowPoses& poses,
                                               TracedBeam& beam) const {
  const std::span<RayPacket8> packets = fill_beam(table, x, y, poses, beam);
  if (packets.empty()) return;
  poses.has_single_pose() ? scene_.intersect(packets) : scene_.intersect_moving(std::span(&packets, 1));
}

TILEFLIGHT_WIDE_VECTORS void BlockTracer::cast_moments(const RayTable& table, int x, int y,
                                                       std::span<const RowPoses> moments,
                                                       std::span<TracedBeam> beams) const {
  std::array<std::span<RayPacket8>, kMostMoments> all;
  for (std::size_t k = 0; k < moments.size(); ++k) all[k] = fill_beam(table, x, y, moments[k], beams[k]);
  if (all[0].empty()) return;
  scene_.intersect_moving(std::span(all).first(moments.size()));
}

void BlockTracer::prefetch_shading(const TracedBeam& beam) const {
  for (std::size_t k = 0; k < static_cast<std::size_t>(beam.size); ++k) prefetch_hits(beam.packets[k], appearance_);
}

namespace {

/// Values that a packet's hits share with those of another packet that meets the same triangles.
struct HitTextures {
  LaneTextures textures;
  TextureGradients8 gradients;
};

bool hits_the_same(const RayPacket8& a, const RayPacket8& b) {
  return std::memcmp(a.mesh, b.mesh, sizeof(a.mesh)) == 0 &&
         std::memcmp(a.triangle, b.triangle, sizeof(a.triangle)) == 0;
}

/// The reads of a block's samples. `hits`: of the packet.
TILEFLIGHT_LANE_INLINE void write_reads(const RayPacket8& packet, const HitTextures& hits, BlockTextureReads& reads) {
  const Footprints8 footprints = compute_footprints(packet, hits.gradients);
  for (int i = 0; i < RayPacket8::kLanes; ++i) {
    reads.material[i] = hits.textures.material[i];
    if (hits.textures.shade[i] != &kNoTexture) reads.read[i] = read_of(*hits.textures.shade[i], packet, footprints, i);
  }
}

TILEFLIGHT_LANE_INLINE void prefetch_block(const HitTextures& hits, const BlockTextureReads& reads) {
  for (int i = 0; i < RayPacket8::kLanes; ++i) {
    if (hits.textures.shade[i] != &kNoTexture) prefetch_texels(hits.textures.material[i]->texture, reads.read[i]);
  }
}

}  // namespace

TILEFLIGHT_WIDE_VECTORS void BlockTracer::compute_texture_reads(std::span<TracedBeam> moments) const {
  const bool has_placed = !scene_.placed().empty();
  for (int k = 0; k < moments[0].size; ++k) {
    HitTextures hits;
    const RayPacket8* of_hits = nullptr;
    for (TracedBeam& beam : moments) {
      const RayPacket8& packet = beam.packets[k];
      // In most exposures a camera moves by less than a triangle, and little more than a texel: what the moment before
      // needed of memory serves the next. Placed parts move themselves.
      const bool is_known = of_hits != nullptr && !has_placed && hits_the_same(packet, *of_hits);
      if (!is_known) {
        find_textures(packet, appearance_, hits.textures);
        gather_gradients(hits.textures, hits.gradients);
        if (has_placed) turn_gradients(scene_, packet, hits.textures, hits.gradients);
        of_hits = &packet;
      }
      write_reads(packet, hits, beam.reads[k]);
      if (!is_known) prefetch_block(hits, beam.reads[k]);
    }
  }
}

std::uint8_t BlockTracer::blending_lanes(std::uint8_t valid, const BlockTextureReads& reads) const {
  if (!appearance_.has_blending()) return 0;
  std::uint8_t lanes = 0;
  for (unsigned i = 0; i < RayPacket8::kLanes; ++i) {
    const Material* material = (valid >> i & 1U) != 0 ? reads.material[i] : nullptr;
    if (material != nullptr && material->blends) lanes = static_cast<std::uint8_t>(lanes | 1U << i);
  }
  return lanes;
}

TILEFLIGHT_WIDE_VECTORS float BlockTracer::opacity(const RayPacket8& packet, const BlockTextureReads& reads,
                                                   int lane) const {
  const auto i = static_cast<std::size_t>(lane);
  const Material* material = reads.material[i];
  if (material == nullptr || !material->blends) return 1.0F;
  float opacity = material->opacity;
  if (material->opacity_texture != nullptr) {
    Texture texture = material->texture;
    texture.pyramid = material->opacity_texture;
    TextureRead read = reads.read[i];
    read.lod = std::min(read.lod, static_cast<float>(texture.pyramid->levels() - 1));
    opacity *= SrgbTables::get().decode(std::sqrt(sample_squares(texture, read)[0]));
  }
  if (material->vertex_colors != nullptr) {
    const imaging::TexturedMesh& mesh = scene_.meshes()[packet.mesh[lane]];
    opacity *= interpolate_colors(mesh, packet.triangle[lane], packet.u[lane], packet.v[lane], 3);
  }
  return opacity;
}

void BlockTracer::cast_behind(std::uint8_t lanes, RayPacket8& packet, BlockTextureReads& reads) const {
  constexpr float kLeast_m = 1e-3F, kSteps = 32.0F * 1.2e-7F;  // more than the error of a hit
  std::array<float, RayPacket8::kLanes> near{}, time{};
  for (std::size_t i = 0; i < near.size(); ++i) {
    const float origin_m = std::abs(packet.origin_x[i]) + std::abs(packet.origin_y[i]) + std::abs(packet.origin_z[i]);
    near[i] = packet.far[i] + kLeast_m + kSteps * (origin_m + packet.far[i]);
    time[i] = packet.time[i];
  }
  packet.reset();
  for (int i = 0; i < RayPacket8::kLanes; ++i) {
    packet.time[i] = time[static_cast<std::size_t>(i)];
    if ((lanes >> i & 1) != 0) {
      packet.near[i] = near[static_cast<std::size_t>(i)];
    } else {
      packet.disable_lane(i);
    }
  }
  scene_.intersect(packet);
  HitTextures hits;
  find_textures(packet, appearance_, hits.textures);
  gather_gradients(hits.textures, hits.gradients);
  if (!scene_.placed().empty()) turn_gradients(scene_, packet, hits.textures, hits.gradients);
  write_reads(packet, hits, reads);
}

TILEFLIGHT_WIDE_VECTORS void BlockTracer::shade(std::uint8_t valid, const RayPacket8& packet,
                                                const BlockTextureReads& reads, SquaredColors8& shades) const {
  for (std::size_t i = 0; i < shades.size(); ++i) {
    if ((valid >> i & 1U) == 0) continue;
    const Material* material = reads.material[i];
    if (material == nullptr) {
      shades[i] = background_squares_;
      continue;
    }
    Float4 squares{};
    if (material->texture.pyramid != nullptr) squares = sample_squares(material->texture, reads.read[i]);
    const auto lane = static_cast<int>(i);
    shades[i] = material->texture_only ? squares : apply_material_color(*material, packet, lane, squares);
    if (haze_per_m_ > 0.0F) shades[i] = apply_haze(shades[i], packet.far[lane]);
  }
}

/// Koschmieder's law in linear light.
Float4 BlockTracer::apply_haze(const Float4& squares, float distance_m) const {
  const SrgbTables& srgb = SrgbTables::get();
  const float clear = std::exp(-haze_per_m_ * distance_m);
  Float4 result{};
  for (int c = 0; c < 3; ++c) {
    const float light = srgb.decode(std::sqrt(squares[c]));
    const float value = srgb.encode(clear * light + (1.0F - clear) * haze_[static_cast<std::size_t>(c)]);
    result[c] = value * value;
  }
  return result;
}

/// Multiplies the texture (if any) by the mesh's colours, in linear light.
Float4 BlockTracer::apply_material_color(const Material& material, const RayPacket8& packet, int lane,
                                         const Float4& squares) const {
  const SrgbTables& srgb = SrgbTables::get();
  LinearRgb light = material.factor;
  if (material.texture.pyramid != nullptr) {
    for (int c = 0; c < 3; ++c) light[static_cast<std::size_t>(c)] *= srgb.decode(std::sqrt(squares[c]));
  }
  if (material.vertex_colors != nullptr) {
    const imaging::TexturedMesh& mesh = scene_.meshes()[packet.mesh[lane]];
    const LinearRgb colour = vertex_colour(mesh, packet.triangle[lane], packet.u[lane], packet.v[lane]);
    for (std::size_t c = 0; c < 3; ++c) light[c] *= colour[c];
  }
  Float4 result{};
  for (int c = 0; c < 3; ++c) {
    const float value = srgb.encode(light[static_cast<std::size_t>(c)]);
    result[c] = value * value;
  }
  return result;
}

}  // namespace tileflight::render
