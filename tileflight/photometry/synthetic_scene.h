#pragma once

// For tests: a relief with a procedural texture, rendered through any lens from known poses. Rays are intersected with
// the relief by marching and false position, independently of the odometry's own projection code.

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <vector>

#include "tileflight/base/simd.h"
#include "tileflight/geometry/transform.h"
#include "tileflight/imaging/camera.h"
#include "tileflight/imaging/image.h"

namespace tileflight::photometry::test_support {

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
  // Of its height a ray loses this much in a metre, at least and at most.
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

using Four = base::Double4;
using FourMask = base::Mask4;

TILEFLIGHT_LANE_INLINE bool any(const FourMask& mask) { return (mask[0] | mask[1] | mask[2] | mask[3]) != 0; }
/// Where the mask is set, the value changes to another.
TILEFLIGHT_LANE_INLINE void change(const FourMask& mask, const Four& to, Four& value) {
  value = reinterpret_cast<Four>((reinterpret_cast<FourMask>(to) & mask) | (reinterpret_cast<FourMask>(value) & ~mask));
}

/// Four rays, for which hit_distance() goes in step over hills of sines: what one waits for, another computes. The bits
/// are those of each ray alone; one that has arrived stays as it is.
struct FourRays {
  std::array<Vec3, 4> origins, rays;
  std::array<double, 4> distances{};  ///< guesses, then where they meet the ground

  TILEFLIGHT_LANE_INLINE void above(const SineHills& hills, const Four& d, Four& out) const {
    Four height_m;
    hills.heights(x + d * along_x, y + d * along_y, height_m);
    out = z + d * along_z - height_m;
  }
  TILEFLIGHT_LANE_INLINE void store(const FourMask& mask, const Four& d) {
    for (int i = 0; i < 4; ++i) distances[i] = mask[i] != 0 ? d[i] : distances[i];
  }

  /// meeting_from_guess()
  TILEFLIGHT_LANE_INLINE void go_from_guess(const SineHills& hills) {
    Four d = guess, slope = -along_z, value, value_there;
    above(hills, d, value);
    Four least{}, most = Four{} + std::numeric_limits<double>::infinity();
    FourMask goes = by_guess;
    for (int i = 0; i < 60; ++i) {
      goes &= (value > 1e-7) | (value < -1e-7);
      if (!any(goes)) break;
      const Four by_slowest = d + value / slowest, by_fastest = d + value / fastest;
      Four low = by_slowest, high = by_slowest;
      change(by_fastest < by_slowest, by_fastest, low);
      change(by_slowest < by_fastest, by_fastest, high);
      change(least < low, low, least);
      change(high < most, high, most);
      Four next = d + value / slope;
      change(~((next > least) & (next < most)), 0.5 * (least + most), next);
      above(hills, next, value_there);
      Four secant = (value - value_there) / (next - d);
      change(fastest < secant, fastest, secant);
      change(secant < slowest, slowest, secant);
      change(goes, secant, slope);
      change(goes, next, d);
      change(goes, value_there, value);
    }
    store(by_guess, d + value / slope);
  }

  /// first_meeting()
  TILEFLIGHT_LANE_INLINE void go_by_steps(const SineHills& hills, double highest_m) {
    constexpr double kFar_m = 300.0;
    Four near{}, near_above, far, far_above, value;
    for (int i = 0; i < 4; ++i)
      if (along_z[i] < 0) near[i] = std::max(0.0, (z[i] - highest_m) / -along_z[i]);
    far = near;
    above(hills, near, near_above);
    far_above = near_above;
    FourMask never{};
    for (FourMask goes = by_steps & (far_above > 0.0); any(goes); goes &= ~never & (far_above > 0.0)) {
      change(goes, far, near);
      change(goes, far_above, near_above);
      Four step = 0.5 * far_above;
      change(step < 0.25, Four{} + 0.25, step);
      change(goes, far + step, far);
      never |= goes & (far > kFar_m);
      above(hills, far, value);
      change(goes, value, far_above);
    }
    Four result{}, kept{};
    FourMask goes = by_steps & ~never, found{};
    for (int i = 0; i < 20; ++i) {
      goes &= (far - near > 1e-9) & (near_above - far_above > 1e-7);
      if (!any(goes)) break;
      const Four share = near_above / (near_above - far_above), between = near + share * (far - near);
      above(hills, between, value);
      const FourMask there = goes & (value < 1e-9) & (value > -1e-9);
      change(there, between, result);
      found |= there;
      goes &= ~there;
      const FourMask is_near = goes & (value > 0.0), is_far = goes & ~(value > 0.0);
      change(is_near, between, near);
      change(is_near, value, near_above);
      change(is_far, between, far);
      change(is_far, value, far_above);
      change(is_near & (kept == 1.0), 0.5 * far_above, far_above);
      change(is_far & (kept == -1.0), 0.5 * near_above, near_above);
      change(is_near, Four{} + 1.0, kept);
      change(is_far, Four{} - 1.0, kept);
    }
    Four fall = near_above - far_above;
    change(fall < 1e-12, Four{} + 1e-12, fall);
    change(by_steps & ~never & ~found, near + (far - near) * near_above / fall, result);
    store(by_steps, result);
  }

  FourMask by_guess{}, by_steps{};
  Four slowest{}, fastest{}, guess{};
  Four x{}, y{}, z{}, along_x{}, along_y{}, along_z{};
};

TILEFLIGHT_WIDE_VECTORS
static void go(FourRays& four, const SineHills& hills, double highest_m) {
  if (any(four.by_guess)) four.go_from_guess(hills);
  if (any(four.by_steps)) four.go_by_steps(hills, highest_m);
}

/// hit_distance() of four rays; `four.distances` begins with their guesses.
inline void hit_distances(const Relief& relief, const SineHills& hills, FourRays& four) {
  four.by_guess = four.by_steps = FourMask{};
  for (int i = 0; i < 4; ++i) {
    const Vec3 &origin = four.origins[i], &ray = four.rays[i];
    double& distance = four.distances[i];
    four.x[i] = origin.x(), four.y[i] = origin.y(), four.z[i] = origin.z();
    four.along_x[i] = ray.x(), four.along_y[i] = ray.y(), four.along_z[i] = ray.z();
    four.slowest[i] = four.fastest[i] = four.guess[i] = 1.0;
    if (ray.z() >= 0 && origin.z() > relief.highest_m) {
      distance = 0.0;
      continue;
    }
    const Descent descent{relief, origin, ray};
    four.slowest[i] = descent.slowest, four.fastest[i] = descent.fastest;
    (falls_faster_than_the_ground(descent) ? four.by_guess : four.by_steps)[i] = -1;
    four.guess[i] = distance > 0 ? distance : origin.z() / -ray.z();
  }
  go(four, hills, relief.highest_m);
}

/// Renders a relief through one camera, one ray per pixel.
class ReliefCamera {
 public:
  ReliefCamera(const imaging::Camera& camera, Relief relief) : camera_(camera), relief_(std::move(relief)) {
    for (int i = 0; i < camera.width() * camera.height(); ++i) {
      rays_.push_back(camera.unproject({i % camera.width(), i / camera.width()}).value_or(Vec3::Zero()));
    }
    const int middle = camera.height() / 2 * camera.width() + camera.width() / 2;
    pixel_rad_ = (rays_[middle] - rays_[middle + 1]).norm();
  }

  const imaging::Camera& camera() const { return camera_; }
  const Relief& relief() const { return relief_; }

  imaging::RgbImage render(const SE3& T_local_camera) const {
    return render_by_rows([&](int) { return T_local_camera; });
  }

  /// Renders each row with its own pose T_local_camera (rolling shutter).
  imaging::RgbImage render_by_rows(const std::function<SE3(int)>& pose_of_row) const {
    imaging::RgbImage image(camera_.width(), camera_.height());
    const auto* hills = relief_.height_m.target<SineHills>();
    tbb::parallel_for(0, (image.height + 3) / 4, [&](int block) {
      std::array<SE3, 4> poses;
      for (int row = 0; row < 4; ++row) poses[row] = pose_of_row(std::min(4 * block + row, image.height - 1));
      render_four_rows(4 * block, poses, hills, image);
    });
    return image;
  }

 private:
  /// From `first` on, as many as there are.
  void render_four_rows(int first, const std::array<SE3, 4>& poses, const SineHills* hills,
                        imaging::RgbImage& image) const {
    std::array<geometry::Mat3, 4> R;
    std::array<double, 4> before{}, last{};  // distances of the two pixels before
    FourRays four;
    for (std::size_t row = 0; row < 4; ++row) {
      R[row] = poses[row].rotation.toRotationMatrix();
      four.origins[row] = poses[row].translation;
    }
    for (int x = 0; x < image.width; ++x) {
      for (int row = 0; row < 4; ++row) {
        const int y = std::min(first + row, image.height - 1);
        four.rays[row] = R[row] * rays_[static_cast<std::size_t>(y) * image.width + x];
        four.distances[row] = 2.0 * last[row] - before[row];  // as it goes on from pixel to pixel
      }
      if (hills != nullptr) {
        hit_distances(relief_, *hills, four);
      } else {
        for (std::size_t row = 0; row < 4; ++row)
          four.distances[row] = hit_distance(relief_, four.origins[row], four.rays[row], four.distances[row]);
      }
      before = last;
      last = four.distances;
      for (int row = 0; row < 4 && first + row < image.height; ++row)
        image(x, first + row) = seen(four.origins[row], four.rays[row], four.distances[row]);
    }
  }

  imaging::Rgb8 seen(const Vec3& origin, const Vec3& ray, double distance) const {
    const Vec3 p = origin + distance * ray;
    const double footprint = distance * pixel_rad_ / std::max(0.2, -ray.z());
    const double value = distance > 0 ? relief_.grey(p.x(), p.y(), footprint) : relief_.sky(ray);
    const auto grey = static_cast<std::uint8_t>(std::lround(value));
    return {grey, grey, grey};
  }

  imaging::Camera camera_;
  Relief relief_;
  std::vector<Vec3> rays_;
  double pixel_rad_ = 0.0;
};

/// Camera pose looking along `forward`, with the world's z axis up in the image.
inline SE3 look_along(const Vec3& position, const Vec3& forward) {
  const Vec3 z = forward.normalized(), x = z.cross(Vec3::UnitZ()).normalized();
  geometry::Mat3 R;
  R << x, z.cross(x), z;
  return SE3(R, position);
}

}  // namespace tileflight::photometry::test_support
