#pragma once

// For tests: a relief with a procedural texture, and where rays meet it: by marching and false position, independently
// of the odometry's own projection code.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>

#include "tileflight/core/base/simd.h"
#include "tileflight/core/geometry/transform.h"

namespace tileflight::keyframes::test_support {

using geometry::SE3;
using geometry::Vec3;

/// Two or four numbers, with which GCC and Clang compute at once.
using Pair = double __attribute__((vector_size(16)));
using PairOfBits = std::uint64_t __attribute__((vector_size(16)));
using FourOfBits = std::uint64_t __attribute__((vector_size(32)));

/// Sines to 1e-9 (Taylor polynomial to r^13 over half a period, |x| < 1e6): renders of sine-shaped ground spend most of
/// their time here, and a fifth of that of std::sin.
template <class Bits, class Numbers>
TILEFLIGHT_LANE_INLINE void sines(const Numbers& x, Numbers& out) {
  constexpr double kPi = 3.14159265358979323846, kToNearest = 6755399441055744.0;  // 1.5 * 2^52
  const Numbers shifted = x * (1.0 / kPi) + kToNearest;
  const Numbers r = x - (shifted - kToNearest) * kPi, r2 = r * r, r4 = r2 * r2;
  // In terms that do not wait for each other.
  const Numbers series = (1.0 - r2 * (1.0 / 6)) + r4 * (1.0 / 120 - r2 * (1.0 / 5040)) +
                         r4 * r4 * ((1.0 / 362880 - r2 * (1.0 / 39916800)) + r4 * (1.0 / 6227020800.0));
  // An odd number of half periods away, the sign changes.
  out = reinterpret_cast<Numbers>(reinterpret_cast<Bits>(r * series) ^ reinterpret_cast<Bits>(shifted) << 63U);
}
inline double sine(double x) {
  Pair both;
  sines<PairOfBits>(Pair{x, x}, both);
  return both[0];
}
inline double cosine(double x) { return sine(x + 1.57079632679489661923); }

/// Smooth noise in 0..1 from a hash of the lattice (value noise with cubic blending).
inline double lattice(std::int64_t x, std::int64_t y, std::uint32_t seed) {
  std::uint64_t h = static_cast<std::uint64_t>(x) * 0x9E3779B97F4A7C15ULL ^
                    static_cast<std::uint64_t>(y) * 0xC2B2AE3D27D4EB4FULL ^ seed;
  h ^= h >> 31;
  h *= 0xD6E8FEB86659FD93ULL;
  h ^= h >> 32;
  return static_cast<double>(h & 0xFFFFFF) / 0xFFFFFF;
}
inline double noise(double x, double y, std::uint32_t seed) {
  const double fx = std::floor(x), fy = std::floor(y);
  const auto ix = static_cast<std::int64_t>(fx), iy = static_cast<std::int64_t>(fy);
  const double u = x - fx, v = y - fy, a = u * u * (3 - 2 * u), b = v * v * (3 - 2 * v);
  const double top = lattice(ix, iy, seed) * (1 - a) + lattice(ix + 1, iy, seed) * a;
  const double bottom = lattice(ix, iy + 1, seed) * (1 - a) + lattice(ix + 1, iy + 1, seed) * a;
  return top * (1 - b) + bottom * b;
}

/// Ground with z up: height(x, y) and a texture, in metres.
struct Relief {
  std::function<double(double, double)> height_m = [](double, double) { return 0.0; };
  double highest_m = 0.0;                                     ///< of height_m
  double steepest = std::numeric_limits<double>::infinity();  ///< no slope of height_m is steeper; rise over run
  double texel_m = 1.0;                                       ///< finest wavelength of the texture
  double period_m = 0.0;                                      ///< period of the texture in x and y; 0: not periodic
  double clouds = 0.0;  ///< amplitude of the sky's texture at infinity, grey values

  /// Grey value of the sky in a direction.
  double sky(const Vec3& ray) const {
    return 200.0 + clouds * (noise(12.0 * ray.x() + 3.0 * ray.z(), 12.0 * ray.y(), 99U) - 0.5);
  }

  /// Grey value of the ground at (x, y). Octaves finer than the pixel footprint fade out, as in a lens.
  double grey(double x, double y, double footprint_m) const {
    if (period_m > 0) x -= period_m * std::floor(x / period_m), y -= period_m * std::floor(y / period_m);
    double sum = 0;
    for (int octave = 0; octave < 3; ++octave) {
      const double size = texel_m * (1 << (2 * octave));
      const double amplitude = std::clamp(size / (3.0 * footprint_m) - 0.3, 0.0, 1.0);
      if (amplitude > 0) sum += amplitude * (noise(x / size, y / size, 7U + octave) - 0.5);
    }
    return std::clamp(125.0 + 75.0 * sum, 0.0, 255.0);
  }
};

/// Hills amplitude_m * sin(k_x x + phase_x) * cos(k_y y + phase_y).
struct SineHills {
  double amplitude_m = 1.5, k_x = 0.35, k_y = 0.28, phase_x = 0.0, phase_y = 0.0;

  double operator()(double x, double y) const {
    Pair both;
    sines<PairOfBits>(Pair{k_x * x + phase_x, k_y * y + phase_y + 1.57079632679489661923}, both);
    return amplitude_m * both[0] * both[1];
  }
  /// At four places; the same bits.
  TILEFLIGHT_LANE_INLINE void heights(const base::Double4& x, const base::Double4& y, base::Double4& height_m) const {
    base::Double4 along_x, along_y;
    sines<FourOfBits>(k_x * x + phase_x, along_x);
    sines<FourOfBits>(k_y * y + phase_y + 1.57079632679489661923, along_y);
    height_m = amplitude_m * along_x * along_y;
  }
};
inline Relief sine_hills(const SineHills& hills, double texel_m) {
  // The squared gradient is (A k_x cos cos)^2 + (A k_y sin sin)^2 <= (A max(k_x, k_y))^2 (cos^2 cos^2 + sin^2 sin^2).
  return {.height_m = hills,
          .highest_m = hills.amplitude_m,
          .steepest = hills.amplitude_m * std::max(hills.k_x, hills.k_y),
          .texel_m = texel_m};
}

/// The height above a relief along a unit ray.
struct Descent {
  const Relief& relief;
  const Vec3 &origin, &ray;
  // A ray loses at least and at most this much height in a metre.
  double slowest = -ray.z() - relief.steepest * std::hypot(ray.x(), ray.y());
  double fastest = -ray.z() + relief.steepest * std::hypot(ray.x(), ray.y());

  double above(double d) const {
    return origin.z() + d * ray.z() - relief.height_m(origin.x() + d * ray.x(), origin.y() + d * ray.y());
  }
};

/// Where a ray falls faster than the ground ever does, it meets it once: secants from a guess, between the bounds that
/// each height sets.
inline double meeting_from_guess(const Descent& descent, double guess) {
  double d = guess, value = descent.above(d), slope = -descent.ray.z();
  double least = 0.0, most = std::numeric_limits<double>::infinity();
  for (int i = 0; i < 60 && std::abs(value) > 1e-7; ++i) {
    const double by_slowest = d + value / descent.slowest, by_fastest = d + value / descent.fastest;
    least = std::max(least, std::min(by_slowest, by_fastest));
    most = std::min(most, std::max(by_slowest, by_fastest));
    double next = d + value / slope;
    if (!(next > least && next < most)) next = 0.5 * (least + most);
    const double value_there = descent.above(next);
    slope = std::clamp((value - value_there) / (next - d), descent.slowest, descent.fastest);
    d = next, value = value_there;
  }
  return d + value / slope;
}

/// The first of all meetings, by steps of half the height.
inline double first_meeting(const Descent& descent) {
  constexpr double kFar_m = 300.0;
  const double above_all = descent.origin.z() - descent.relief.highest_m;
  double near = descent.ray.z() < 0 ? std::max(0.0, above_all / -descent.ray.z()) : 0.0, far = near;
  double near_above = descent.above(near), far_above = near_above;
  while (far_above > 0) {
    near = far;
    near_above = far_above;
    far += std::max(0.25, 0.5 * far_above);
    if (far > kFar_m) return 0.0;
    far_above = descent.above(far);
  }
  // False position, of which the end that stays twice counts half ("Illinois": Dowell and Jarratt, BIT 11, 1971).
  int kept = 0;
  for (int i = 0; i < 20 && far - near > 1e-9 && near_above - far_above > 1e-7; ++i) {
    const double share = near_above / (near_above - far_above), between = near + share * (far - near);
    const double value = descent.above(between);
    if (std::abs(value) < 1e-9) return between;
    if (value > 0) {
      near = between, near_above = value;
      if (kept == 1) far_above *= 0.5;
      kept = 1;
    } else {
      far = between, far_above = value;
      if (kept == -1) near_above *= 0.5;
      kept = -1;
    }
  }
  return near + (far - near) * near_above / std::max(near_above - far_above, 1e-12);
}

/// Whether meeting_from_guess() may be asked.
inline bool falls_faster_than_the_ground(const Descent& descent) {
  return descent.slowest > 0.05 && descent.origin.z() > descent.relief.highest_m;
}

/// Distance along a unit ray to the relief; 0 where it meets none. `guess_m`: of a ray beside it, if known.
inline double hit_distance(const Relief& relief, const Vec3& origin, const Vec3& ray, double guess_m = 0.0) {
  if (ray.z() >= 0 && origin.z() > relief.highest_m) return 0.0;
  const Descent descent{relief, origin, ray};
  if (falls_faster_than_the_ground(descent))
    return meeting_from_guess(descent, guess_m > 0 ? guess_m : origin.z() / -ray.z());
  return first_meeting(descent);
}

}  // namespace tileflight::keyframes::test_support
