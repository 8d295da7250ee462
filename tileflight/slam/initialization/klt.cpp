#include "tileflight/slam/initialization/klt.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

#include "tileflight/core/base/simd.h"

namespace tileflight::initialization {
namespace {

using Eigen::Matrix2f;
using Eigen::Vector2f;

constexpr int kRadius = 5;
constexpr int kSide = 2 * kRadius + 1;
constexpr int kPixels = kSide * kSide;
constexpr float kMargin_px = kRadius + 2.0F;

/// Minimum eigenvalue of the mean of grad grad^T around a pixel.
float corner_strength(const keyframes::PyramidLevel& level, int x, int y) {
  constexpr int kReach = 3;
  float a = 0, b = 0, c = 0;
  for (int dy = -kReach; dy <= kReach; ++dy) {
    for (int dx = -kReach; dx <= kReach; ++dx) {
      const keyframes::Texel t = level.at(x + dx, y + dy);
      a += t[keyframes::kGradX] * t[keyframes::kGradX];
      b += t[keyframes::kGradX] * t[keyframes::kGradY];
      c += t[keyframes::kGradY] * t[keyframes::kGradY];
    }
  }
  const float n = (2 * kReach + 1) * (2 * kReach + 1);
  return (0.5F * (a + c) - std::sqrt(0.25F * (a - c) * (a - c) + b * b)) / n;
}

struct Corner {
  int x = 0;
  int y = 0;
  float strength = 0;
};

/// Strongest pixel of a cell; searches every second pixel first.
Corner best_corner(const keyframes::PyramidLevel& level, const keyframes::RayTable& rays, int x0, int y0, int edge) {
  constexpr int kBorder = 12;
  Corner best;
  for (int y = std::max(y0, kBorder); y < std::min(y0 + edge, level.height - kBorder); y += 2) {
    for (int x = std::max(x0, kBorder); x < std::min(x0 + edge, level.width - kBorder); x += 2) {
      if (level.gradient_squared(x, y) < 16.0F || rays.at(x, y).isZero(0)) continue;
      const float strength = corner_strength(level, x, y);
      if (strength > best.strength) best = {x, y, strength};
    }
  }
  return best;
}

constexpr int kRows = (kPixels + base::kLanes - 1) / base::kLanes;  ///< SIMD vectors per patch

/// A patch's pixels in row order, padded with zeros to whole SIMD vectors.
using PatchValues = std::array<base::Float8, kRows>;

TILEFLIGHT_LANE_INLINE void set_value(PatchValues& values, int pixel, float value) {
  values[pixel / base::kLanes][pixel % base::kLanes] = value;
}

/// Subtracts the mean from every pixel; the padding stays zero.
TILEFLIGHT_LANE_INLINE void subtract_mean(PatchValues& values) {
  constexpr base::Float8 kLast{1};  // valid pixels in the last SIMD vector
  static_assert(kPixels % base::kLanes == 1);
  base::Float8 sum{};
  for (const base::Float8& row : values) sum += row;
  const float mean = base::horizontal_sum(sum) / kPixels;
  for (base::Float8& row : values) row -= mean;
  values.back() *= kLast;
}

TILEFLIGHT_LANE_INLINE float dot(const PatchValues& a, const PatchValues& b) {
  base::Float8 sum{};
  for (int i = 0; i < kRows; ++i) sum += a[i] * b[i];
  return base::horizontal_sum(sum);
}

/// Patch of one point at one level, with the quantities precomputed for its alignment.
struct Template {
  PatchValues value{};  ///< mean subtracted
  PatchValues gradient_x{};
  PatchValues gradient_y{};
  Matrix2f inverse_normal;
  float deviation = 0;
};

TILEFLIGHT_WIDE_VECTORS
bool make_template(const keyframes::PyramidLevel& level, const Vector2f& center, Template& out) {
  if (!level.inside(center.x(), center.y(), kMargin_px)) return false;
  for (int k = 0; k < kPixels; ++k) {
    const keyframes::Texel t = level.sample(center.x() + static_cast<float>(k % kSide - kRadius),
                                            center.y() + static_cast<float>(k / kSide - kRadius));
    set_value(out.value, k, t[keyframes::kIntensity]);
    set_value(out.gradient_x, k, t[keyframes::kGradX]);
    set_value(out.gradient_y, k, t[keyframes::kGradY]);
  }
  subtract_mean(out.value);
  out.deviation = std::sqrt(dot(out.value, out.value) / kPixels);
  const float xx = dot(out.gradient_x, out.gradient_x), xy = dot(out.gradient_x, out.gradient_y);
  const float yy = dot(out.gradient_y, out.gradient_y);
  Matrix2f normal;
  normal << xx, xy, xy, yy;
  if (normal.determinant() < 1e-3F * normal.trace() * normal.trace() || out.deviation < 0.5F) return false;
  out.inverse_normal = normal.inverse();
  return true;
}

/// Samples the patch around a position; all pixels share one pair of weights, since they are whole pixels apart.
TILEFLIGHT_LANE_INLINE void sample_patch(const keyframes::PyramidLevel& level, const Vector2f& center,
                                         PatchValues& out) {
  const int ix = static_cast<int>(center.x()), iy = static_cast<int>(center.y());
  const float dx = center.x() - static_cast<float>(ix), dy = center.y() - static_cast<float>(iy);
  std::array<float, kRows * base::kLanes> value{};
  for (int v = 0; v < kSide; ++v) {
    const float* top = level.row(iy + v - kRadius) + ix - kRadius;
    const float* bottom = top + level.width;
    for (const int u : {0, kSide - base::kLanes}) {  // the two loads overlap
      base::Float8 a, b, c, d;
      base::load_float8(top + u, a), base::load_float8(top + u + 1, b), base::load_float8(bottom + u, c),
          base::load_float8(bottom + u + 1, d);
      const base::Float8 above = a + dx * (b - a), below = c + dx * (d - c);
      base::store_float8(above + dy * (below - above), value.data() + v * kSide + u);
    }
  }
  std::memcpy(out.data(), value.data(), sizeof(out));
}

/// Aligns starting from `position`; false if it leaves the image. `correlation`: normalised, at the final position.
TILEFLIGHT_WIDE_VECTORS
bool align_patch(const Template& patch, const keyframes::PyramidLevel& to, Vector2f& position, float& correlation) {
  constexpr int kIterations = 15;
  PatchValues value;
  for (int i = 0; i < kIterations; ++i) {
    if (!to.inside(position.x(), position.y(), kMargin_px)) return false;
    sample_patch(to, position, value);
    subtract_mean(value);
    const float deviation = std::max(std::sqrt(dot(value, value) / kPixels), 0.1F);
    const float gain = patch.deviation / deviation;
    base::Float8 bx{}, by{};
    for (int k = 0; k < kRows; ++k) {
      const base::Float8 difference = value[k] * gain - patch.value[k];
      bx += patch.gradient_x[k] * difference;
      by += patch.gradient_y[k] * difference;
    }
    correlation = dot(value, patch.value) / (kPixels * deviation * patch.deviation);
    const Vector2f step = patch.inverse_normal * Vector2f(base::horizontal_sum(bx), base::horizontal_sum(by));
    position -= step;
    if (step.squaredNorm() < 1e-4F) break;
  }
  return true;
}

float level_scale(int level) { return 1.0F / static_cast<float>(1 << level); }
Vector2f to_level(const Vector2f& p, int level) {
  return (p + Vector2f::Constant(0.5F)) * level_scale(level) - Vector2f::Constant(0.5F);
}
Vector2f to_level0(const Vector2f& p, int level) {
  return (p + Vector2f::Constant(0.5F)) / level_scale(level) - Vector2f::Constant(0.5F);
}

std::optional<Vector2f> track_corner(const keyframes::Pyramid& from, const keyframes::Pyramid& to,
                                     const Vector2f& point, const Vector2f& guess, int coarsest) {
  // Chosen by hand.
  constexpr float kMinCorrelation = 0.85F;
  Vector2f position = guess;
  float correlation = 0;
  bool aligned = false;
  for (int l = std::min(coarsest, static_cast<int>(from.levels.size()) - 1); l >= 0; --l) {
    Template patch;
    aligned = false;
    if (!make_template(from.levels[l], to_level(point, l), patch)) continue;
    Vector2f found = to_level(position, l);
    if (!align_patch(patch, to.levels[l], found, correlation)) continue;
    const Vector2f moved = to_level0(found, l);
    // A bad fit on a coarse level must not spoil the finer ones.
    if (l > 0 && correlation < 0.5F) continue;
    position = moved;
    aligned = true;
  }
  if (!aligned || correlation < kMinCorrelation) return std::nullopt;
  return position;
}

/// Follows each point from its guess, and back from there.
std::vector<std::optional<Vector2f>> track_corners_between(const keyframes::Pyramid& from, const keyframes::Pyramid& to,
                                                           const std::vector<Vector2f>& points,
                                                           const std::vector<Vector2f>& guesses, int coarsest) {
  // Largest forward-backward error. Chosen by hand.
  constexpr float kMaxReturn_px = 0.5F;
  std::vector<std::optional<Vector2f>> tracked(points.size());
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, points.size(), 16), [&](const auto& range) {
    for (std::size_t i = range.begin(); i < range.end(); ++i) {
      const auto there = track_corner(from, to, points[i], guesses[i], coarsest);
      if (!there) continue;
      const auto back = track_corner(to, from, *there, points[i], coarsest);
      if (back && (*back - points[i]).norm() < kMaxReturn_px) tracked[i] = there;
    }
  });
  return tracked;
}

}  // namespace

std::vector<Vector2f> find_corners(const keyframes::Pyramid& pyramid, const keyframes::RayTable& rays, int wanted) {
  const keyframes::PyramidLevel& level = pyramid.levels[0];
  const int edge =
      std::max(8, static_cast<int>(std::sqrt(static_cast<double>(level.width) * level.height / (1.5 * wanted))));
  std::vector<Corner> corners;
  for (int y = 0; y < level.height; y += edge) {
    for (int x = 0; x < level.width; x += edge) {
      const Corner corner = best_corner(level, rays, x, y, edge);
      if (corner.strength > 1.0F) corners.push_back(corner);
    }
  }
  std::stable_sort(corners.begin(), corners.end(),
                   [](const Corner& a, const Corner& b) { return a.strength > b.strength; });
  if (static_cast<int>(corners.size()) > wanted) corners.resize(wanted);
  std::vector<Vector2f> points;
  for (const Corner& corner : corners) points.emplace_back(corner.x, corner.y);
  return points;
}

std::vector<std::optional<Vector2f>> track_corners(const keyframes::Pyramid& from, const keyframes::Pyramid& to,
                                                   const std::vector<Vector2f>& points) {
  return track_corners_between(from, to, points, points, static_cast<int>(from.levels.size()));
}

std::vector<std::optional<Vector2f>> track_corners_from(const keyframes::Pyramid& from, const keyframes::Pyramid& to,
                                                        const std::vector<Vector2f>& points,
                                                        const std::vector<Vector2f>& guesses) {
  constexpr int kCoarsest = 3;  // 8 pixels a pixel; chosen by hand
  return track_corners_between(from, to, points, guesses, kCoarsest);
}

}  // namespace tileflight::initialization
