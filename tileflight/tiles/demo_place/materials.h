#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cstdint>
#include <string_view>

namespace tileflight::demo_place {

/// Returns whether (x, y) is inside a letter stroke of a line of capitals, digits and blanks, which is 7 units high
/// from the baseline and has 6 units per letter.
bool is_ink(std::string_view text, double x, double y);

/// Returns the width of a text in the units of is_ink().
inline double text_width(std::string_view text) { return 6.0 * static_cast<double>(text.size()) - 1.0; }

/// Red, green, blue in 0..1, encoded as images are (sRGB-like), before light and shadow.
using Color = Eigen::Array3f;

/// Blends two colours.
inline Color mix_colors(const Color& a, const Color& b, float share_of_b) { return a + share_of_b * (b - a); }

/// Returns 1 inside (negative distance) and 0 outside, blended over `softness_m`: antialiasing of painted edges.
inline float edge_coverage(double signed_distance_m, double softness_m = 0.05) {
  return static_cast<float>(std::clamp(0.5 - signed_distance_m / softness_m, 0.0, 1.0));
}

/// Returns the coverage of the band of `width_m` around multiples of `spacing_m` along one axis (joints, painted
/// lines).
float band_coverage(double position_m, double spacing_m, double width_m, double softness_m = 0.04);

/// Colours of materials. Each function returns the colour at surface coordinates (x, y) in metres, with structure from
/// metres down to the texel and without repetition. `seed` varies surfaces of the same material.
namespace material {
Color lawn(double x, double y, std::uint32_t seed);
Color forest_floor(double x, double y, std::uint32_t seed);
Color turf(double x, double y, std::uint32_t seed);
Color asphalt(double x, double y, std::uint32_t seed);
Color concrete(double x, double y, double joint_spacing_m, std::uint32_t seed);
Color brick(double x, double y, const Color& base, std::uint32_t seed);
Color roof_gravel(double x, double y, std::uint32_t seed);
Color roof_membrane(double x, double y, std::uint32_t seed);
Color metal(double x, double y, const Color& base, std::uint32_t seed);
Color foliage(double x, double y, double z, const Color& base, std::uint32_t seed);
Color bark(double x, double y, std::uint32_t seed);
Color glass(double x, double y, std::uint32_t seed);
Color mulch(double x, double y, std::uint32_t seed);
Color plaster(double x, double y, std::uint32_t seed);  ///< its tone comes from the seed
Color roof_tiles(double x, double y, std::uint32_t seed);
Color cobbles(double x, double y, std::uint32_t seed);
Color rock(const Eigen::Vector3d& at, std::uint32_t seed);  ///< strata along z
Color crop(double x, double y, std::uint32_t seed);         ///< rows along x

}  // namespace material

}  // namespace tileflight::demo_place
