#include "tileflight/tiles/demo_place/materials.h"

#include <array>
#include <cmath>
#include <cstddef>

#include "tileflight/core/base/noise.h"

namespace tileflight::demo_place {
namespace {

struct Glyph {
  char letter;
  std::array<unsigned char, 7> rows;  ///< top to bottom; bit 4 is the leftmost of 5 columns
};

constexpr std::array<Glyph, 22> kGlyphs{
    {{'0', {14, 17, 19, 21, 25, 17, 14}}, {'1', {4, 12, 4, 4, 4, 4, 14}},      {'2', {14, 17, 1, 6, 8, 16, 31}},
     {'3', {30, 1, 1, 14, 1, 1, 30}},     {'4', {2, 6, 10, 18, 31, 2, 2}},     {'5', {31, 16, 30, 1, 1, 17, 14}},
     {'6', {6, 8, 16, 30, 17, 17, 14}},   {'7', {31, 1, 2, 4, 8, 8, 8}},       {'8', {14, 17, 17, 14, 17, 17, 14}},
     {'9', {14, 17, 17, 15, 1, 2, 12}},   {'T', {31, 4, 4, 4, 4, 4, 4}},       {'I', {14, 4, 4, 4, 4, 4, 14}},
     {'L', {16, 16, 16, 16, 16, 16, 31}}, {'E', {31, 16, 16, 30, 16, 16, 31}}, {'F', {31, 16, 16, 30, 16, 16, 16}},
     {'G', {14, 17, 16, 23, 17, 17, 14}}, {'H', {17, 17, 17, 31, 17, 17, 17}}, {'O', {14, 17, 17, 17, 17, 17, 14}},
     {'M', {17, 27, 21, 21, 17, 17, 17}}, {'U', {17, 17, 17, 17, 17, 17, 14}}, {'S', {15, 16, 16, 14, 1, 1, 30}},
     {'A', {14, 17, 17, 31, 17, 17, 17}}}};

}  // namespace

bool is_ink(std::string_view text, double x, double y) {
  if (x < 0 || y < 0 || y >= 7) return false;
  const auto place = static_cast<std::size_t>(x / 6.0);
  const double column = x - 6.0 * static_cast<double>(place);
  if (place >= text.size() || column >= 5) return false;
  for (const Glyph& glyph : kGlyphs) {
    if (glyph.letter != text[place]) continue;
    const unsigned row = glyph.rows[6 - static_cast<std::size_t>(y)];
    return ((row >> (4 - static_cast<unsigned>(column))) & 1U) != 0;
  }
  return false;
}

namespace {

float clamp01(float v) { return std::clamp(v, 0.0F, 1.0F); }

/// Smooth step: 0 below `low`, 1 above `high`.
float step(float low, float high, float v) {
  const float t = clamp01((v - low) / (high - low));
  return t * t * (3.0F - 2.0F * t);
}

/// Single grains of about `size_m`, in [-1, 1].
float grain(double x, double y, double size_m, std::uint32_t seed) {
  return base::value_noise(x / size_m, y / size_m, seed);
}

/// Thin winding lines where noise changes sign; 1 on the line.
float cracks(double x, double y, double size_m, float width, std::uint32_t seed) {
  const double warp = 0.35 * base::value_noise(x / (0.3 * size_m), y / (0.3 * size_m), seed ^ 77U);
  const float v = base::value_noise(x / size_m + warp, y / size_m - warp, seed);
  return 1.0F - step(0.3F * width, width, std::fabs(v));
}

}  // namespace

float band_coverage(double position_m, double spacing_m, double width_m, double softness_m) {
  const double from_nearest = std::fabs(position_m - spacing_m * std::nearbyint(position_m / spacing_m));
  return edge_coverage(from_nearest - width_m / 2, softness_m);
}

namespace material {

Color lawn(double x, double y, std::uint32_t seed) {
  const float broad = base::fractal_noise(x / 19.0, y / 19.0, seed, 2);
  const float tufts = base::fractal_noise(x / 1.1, y / 1.1, seed + 1, 3, 0.6F);
  const float blades = grain(x, y, 0.09, seed + 2);
  Color color = mix_colors({0.29F, 0.38F, 0.16F}, {0.44F, 0.47F, 0.23F}, clamp01(0.45F + 0.5F * broad));
  color *= 1.0F + 0.24F * tufts + 0.24F * blades;
  const float dry = base::fractal_noise(x / 4.7, y / 4.7, seed + 3, 3, 0.6F);
  color = mix_colors(color, {0.58F, 0.53F, 0.33F}, 0.7F * step(0.28F, 0.75F, dry));
  const float bare = base::fractal_noise(x / 7.9, y / 7.9, seed + 4, 4, 0.6F);
  color = mix_colors(color, Color(0.47F, 0.36F, 0.25F) * (1.0F + 0.25F * blades), step(0.48F, 0.62F, bare));
  return color * (1.0F - 0.42F * step(0.72F, 0.86F, grain(x, y, 0.33, seed + 5)));  // weeds
}

Color forest_floor(double x, double y, std::uint32_t seed) {
  const float broad = base::fractal_noise(x / 6.0, y / 6.0, seed, 4, 0.6F);
  const float litter = grain(x, y, 0.14, seed + 1) + 0.7F * grain(x, y, 0.4, seed + 2);
  Color color = mix_colors({0.36F, 0.28F, 0.19F}, {0.30F, 0.33F, 0.17F}, clamp01(0.5F + 0.9F * broad));
  color *= 1.0F + 0.26F * litter;
  return mix_colors(color, {0.66F, 0.49F, 0.27F}, 0.75F * step(0.60F, 0.75F, grain(x, y, 0.19, seed + 3)));  // leaves
}

Color turf(double x, double y, std::uint32_t seed) {
  const bool light_stripe = (base::floor_to_int(y / 4.572) & 1) != 0;
  const float broad = base::fractal_noise(x / 13.0, y / 13.0, seed, 2);
  const float clumps = base::fractal_noise(x / 0.8, y / 0.8, seed + 1, 4, 0.65F);
  Color color = light_stripe ? Color(0.34F, 0.45F, 0.22F) : Color(0.27F, 0.37F, 0.17F);
  color *= 1.0F + 0.12F * broad + 0.24F * clumps + 0.22F * grain(x, y, 0.09, seed + 2);
  const float use = 0.25F - static_cast<float>(std::fabs(x)) / 60.0F;  // the middle of the field is worn most
  const float wear = base::fractal_noise(x / 5.3, y / 5.3, seed + 3, 4, 0.6F) + use;
  return mix_colors(color, Color(0.50F, 0.45F, 0.28F) * (1.0F + 0.2F * clumps), 0.75F * step(0.40F, 0.80F, wear));
}

Color asphalt(double x, double y, std::uint32_t seed) {
  const float broad = base::fractal_noise(x / 8.0, y / 8.0, seed, 3);
  const float stones = grain(x, y, 0.07, seed + 1) + 0.6F * grain(x, y, 0.19, seed + 2);
  Color color = Color(0.40F, 0.40F, 0.41F) * (1.0F + 0.14F * broad + 0.13F * stones);
  const float patch = base::cell_random(x / 5.5 + 0.2 * base::value_noise(x / 9, y / 9, seed), y / 3.1, seed + 3);
  if (patch > 0.90F) color *= 0.72F + 0.3F * (patch - 0.9F);
  const float stain = base::fractal_noise(x / 1.7, y / 1.7, seed + 4, 3, 0.6F);
  color *= 1.0F - 0.38F * step(0.46F, 0.8F, stain);
  color *= 1.0F - 0.55F * cracks(x, y, 4.3, 0.035F, seed + 5);
  return color * (1.0F - 0.35F * cracks(x, y, 1.3, 0.05F, seed + 6) * step(0.1F, 0.5F, broad));
}

Color concrete(double x, double y, double joint_spacing_m, std::uint32_t seed) {
  const float slab = base::cell_random(x / joint_spacing_m, y / joint_spacing_m, seed) - 0.5F;
  const float broad = base::fractal_noise(x / 3.1, y / 3.1, seed + 1, 4, 0.6F);
  const float pores = grain(x, y, 0.08, seed + 2);
  Color color = Color(0.66F, 0.64F, 0.60F) * (1.0F + 0.16F * slab + 0.13F * broad + 0.07F * pores);
  const float stain = base::fractal_noise(x / 1.2, y / 1.2, seed + 3, 3, 0.65F);
  color *= 1.0F - 0.35F * step(0.38F, 0.8F, stain);
  const float gum = base::cell_random(x / 0.12, y / 0.12, seed + 4);
  if (gum > 0.992F) color *= 0.6F;
  const float joint = std::max(band_coverage(x, joint_spacing_m, 0.06), band_coverage(y, joint_spacing_m, 0.06));
  color *= 1.0F - 0.42F * joint;
  return color * (1.0F - 0.4F * cracks(x, y, 5.7, 0.02F, seed + 5));
}

Color brick(double x, double y, const Color& base, std::uint32_t seed) {
  constexpr double kLength_m = 0.40, kHeight_m = 0.20;
  const std::int32_t course = base::floor_to_int(y / kHeight_m);
  const double along = x + (course & 1) * kLength_m / 2;
  const float one = base::cell_random(along / kLength_m, y / kHeight_m, seed) - 0.5F;
  const float broad = base::fractal_noise(x / 4.0, y / 2.5, seed + 1, 4, 0.6F);
  Color color = base * (1.0F + 0.42F * one + 0.14F * broad + 0.08F * grain(x, y, 0.07, seed + 2));
  const float streak = base::fractal_noise(x / 0.7, y / 6.0, seed + 3, 4, 0.6F);
  color *= 1.0F - 0.25F * step(0.3F, 0.8F, streak);
  const float mortar = std::max(band_coverage(along, kLength_m, 0.025), band_coverage(y, kHeight_m, 0.025));
  return mix_colors(color, {0.66F, 0.62F, 0.57F}, 0.55F * mortar);
}

Color roof_gravel(double x, double y, std::uint32_t seed) {
  const float broad = base::fractal_noise(x / 5.0, y / 5.0, seed, 5, 0.6F);
  const float stones = grain(x, y, 0.08, seed + 1) + 0.6F * grain(x, y, 0.21, seed + 2);
  Color color = Color(0.57F, 0.55F, 0.52F) * (1.0F + 0.18F * broad + 0.19F * stones);
  const float pond = base::fractal_noise(x / 7.3, y / 7.3, seed + 3, 3);
  color *= 1.0F - 0.33F * step(0.25F, 0.5F, pond);
  const float tar = base::cell_random(x / 3.7, y / 2.2, seed + 4);
  return tar > 0.95F ? Color(color * 0.55F) : color;
}

Color roof_membrane(double x, double y, std::uint32_t seed) {
  const float sheet = base::cell_random(x / 1.9, y / 11.0, seed) - 0.5F;
  const float dirt = base::fractal_noise(x / 3.7, y / 3.7, seed + 1, 5, 0.6F);
  Color color = Color(0.76F, 0.76F, 0.74F) * (1.0F + 0.08F * sheet + 0.06F * grain(x, y, 0.1, seed + 2));
  color *= 1.0F - 0.35F * step(0.05F, 0.7F, dirt);
  color *= 1.0F - 0.3F * std::max(band_coverage(x, 1.9, 0.06), band_coverage(y, 11.0, 0.06));
  return base::cell_random(x / 2.3, y / 2.9, seed + 3) > 0.965F ? Color(color * 0.6F) : color;
}

Color metal(double x, double y, const Color& base, std::uint32_t seed) {
  const float sheet = base::cell_random(x / 0.9, 0.0, seed) - 0.5F;
  const float streak = base::fractal_noise(x / 0.35, y / 2.6, seed + 1, 4, 0.6F);
  Color color = base * (1.0F + 0.10F * sheet + 0.10F * streak);
  color *= 1.0F - 0.30F * band_coverage(x, 0.9, 0.05);
  const float rust = base::fractal_noise(x / 1.3, y / 1.3, seed + 2, 4, 0.6F);
  return mix_colors(color, {0.45F, 0.28F, 0.16F}, 0.6F * step(0.5F, 0.75F, rust));
}

Color foliage(double x, double y, double z, const Color& base, std::uint32_t seed) {
  const float boughs = base::fractal_noise_3d(x / 1.6, y / 1.6, z / 1.6, seed, 2);
  const float twigs = base::fractal_noise_3d(x / 0.42, y / 0.42, z / 0.42, seed + 1, 2, 0.7F);
  Color color = base * (0.92F + 0.36F * boughs + 0.42F * twigs);
  const float gap = 0.6F * boughs + 0.6F * twigs;
  color = mix_colors(color, {0.08F, 0.10F, 0.05F}, 0.75F * step(0.12F, 0.55F, -gap));
  return mix_colors(color, {0.66F, 0.68F, 0.38F}, 0.35F * step(0.45F, 0.85F, gap));
}

Color bark(double x, double y, std::uint32_t seed) {
  const float ridges = base::fractal_noise(x / 0.12, y / 0.7, seed, 3, 0.6F);
  return Color(0.36F, 0.29F, 0.23F) * (1.0F + 0.4F * ridges);
}

Color glass(double x, double y, std::uint32_t seed) {
  const float reflection = base::fractal_noise(x / 2.1, y / 1.4, seed, 4, 0.6F);
  return Color(0.20F, 0.25F, 0.31F) * (1.0F + 0.5F * reflection);
}

Color mulch(double x, double y, std::uint32_t seed) {
  const float chips = grain(x, y, 0.08, seed) + 0.8F * grain(x, y, 0.22, seed + 1);
  return Color(0.38F, 0.25F, 0.17F) * (1.0F + 0.33F * chips);
}

Color plaster(double x, double y, std::uint32_t seed) {
  constexpr std::array<std::array<float, 3>, 6> kTones{{{0.84F, 0.79F, 0.68F},
                                                        {0.78F, 0.66F, 0.50F},
                                                        {0.74F, 0.56F, 0.46F},
                                                        {0.72F, 0.74F, 0.70F},
                                                        {0.83F, 0.76F, 0.55F},
                                                        {0.62F, 0.66F, 0.70F}}};
  const auto& tone = kTones[base::murmur3_mix(seed) % kTones.size()];
  const float broad = base::fractal_noise(x / 3.3, y / 2.7, seed + 1, 4, 0.6F);
  Color color = Color(tone[0], tone[1], tone[2]) * (1.0F + 0.10F * broad + 0.06F * grain(x, y, 0.09, seed + 2));
  const float streak = base::fractal_noise(x / 0.5, y / 5.0, seed + 3, 4, 0.6F);
  color *= 1.0F - 0.28F * step(0.3F, 0.8F, streak);
  const float bare = base::fractal_noise(x / 1.9, y / 1.5, seed + 4, 4, 0.6F);  // where it has fallen off
  return mix_colors(color, brick(x, y, {0.55F, 0.36F, 0.27F}, seed + 5), step(0.52F, 0.60F, bare));
}

Color roof_tiles(double x, double y, std::uint32_t seed) {
  constexpr double kTile_m = 0.28, kRow_m = 0.36;
  const double along = x + (base::floor_to_int(y / kRow_m) & 1) * kTile_m / 2;
  const float one = base::cell_random(along / kTile_m, y / kRow_m, seed) - 0.5F;
  const float broad = base::fractal_noise(x / 2.6, y / 2.6, seed + 1, 4, 0.6F);
  const Color base = (base::murmur3_mix(seed) & 3U) == 0 ? Color(0.36F, 0.34F, 0.34F) : Color(0.58F, 0.31F, 0.21F);
  Color color = base * (1.0F + 0.45F * one + 0.20F * broad);
  const float moss = base::fractal_noise(x / 1.4, y / 1.4, seed + 2, 4, 0.6F);
  color = mix_colors(color, {0.36F, 0.38F, 0.22F}, 0.6F * step(0.35F, 0.7F, moss));
  return color * (1.0F - 0.45F * std::max(band_coverage(along, kTile_m, 0.03), band_coverage(y, kRow_m, 0.05)));
}

Color cobbles(double x, double y, std::uint32_t seed) {
  constexpr double kStone_m = 0.24;
  const double along =
      x + 0.06 * base::value_noise(x / 1.1, y / 1.1, seed) + (base::floor_to_int(y / kStone_m) & 1) * 0.12;
  const float one = base::cell_random(along / kStone_m, y / kStone_m, seed + 1) - 0.5F;
  const float broad = base::fractal_noise(x / 4.1, y / 4.1, seed + 2, 4, 0.6F);
  Color color = Color(0.50F, 0.47F, 0.43F) * (1.0F + 0.5F * one + 0.22F * broad);
  return color * (1.0F - 0.5F * std::max(band_coverage(along, kStone_m, 0.03), band_coverage(y, kStone_m, 0.03)));
}

Color rock(const Eigen::Vector3d& at, std::uint32_t seed) {
  const double bend = 1.6 * base::fractal_noise(at.x() / 23, at.y() / 23, seed, 3);
  const float layer = base::value_noise((at.z() + bend) / 1.3, 0.5, seed + 1);
  const float fine = base::value_noise((at.z() + bend) / 0.28, 0.5, seed + 2);
  const float broad = base::fractal_noise_3d(at.x() / 3.7, at.y() / 3.7, at.z() / 3.7, seed + 3, 4, 0.6F);
  const float grains = base::fractal_noise_3d(at.x() / 0.3, at.y() / 0.3, at.z() / 0.3, seed + 4, 2, 0.6F);
  Color color = mix_colors({0.55F, 0.47F, 0.38F}, {0.42F, 0.38F, 0.35F}, clamp01(0.5F + 0.6F * layer));
  color *= 1.0F + 0.20F * fine + 0.22F * broad + 0.22F * grains;
  return mix_colors(color, {0.24F, 0.25F, 0.19F}, 0.7F * step(0.35F, 0.7F, broad - 0.3F * layer));  // lichen
}

Color crop(double x, double y, std::uint32_t seed) {
  const double row = y + 0.10 * base::value_noise(x / 3.0, y / 3.0, seed);
  const float leaves = band_coverage(row, 0.75, 0.40, 0.25);
  const float growth = base::fractal_noise(x / 6.0, y / 6.0, seed + 1, 4, 0.6F);
  const Color soil = Color(0.42F, 0.33F, 0.24F) * (1.0F + 0.25F * grain(x, y, 0.12, seed + 2) + 0.15F * growth);
  const Color green = Color(0.33F, 0.42F, 0.18F) * (1.0F + 0.35F * grain(x, y, 0.2, seed + 3) + 0.25F * growth);
  return mix_colors(soil, green, leaves * clamp01(0.7F + 0.9F * growth));
}

}  // namespace material

}  // namespace tileflight::demo_place
