#include "tileflight/odometry/klt.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

#include "tileflight/odometry/lanes.h"

namespace tileflight::odometry {
namespace {

using Eigen::Matrix2f;
using Eigen::Vector2f;

constexpr int kRadius = 5;
constexpr int kSide = 2 * kRadius + 1;
constexpr int kPixels = kSide * kSide;
constexpr float kMargin_px = kRadius + 2.0F;

/// Smaller eigenvalue of the mean of grad grad^T around a pixel.
float corner_strength(const PyramidLevel& level, int x, int y) {
  constexpr int kReach = 3;
  float a = 0, b = 0, c = 0;
  for (int dy = -kReach; dy <= kReach; ++dy) {
    for (int dx = -kReach; dx <= kReach; ++dx) {
      const Texel t = level.at(x + dx, y + dy);
      a += t[kGradX] * t[kGradX];
      b += t[kGradX] * t[kGradY];
      c += t[kGradY] * t[kGradY];
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

/// The strongest pixel of a cell; looks at every second pixel first.
Corner best_corner(const PyramidLevel& level, const RayTable& rays, int x0, int y0, int edge) {
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

constexpr int kRows = (kPixels + kLanes - 1) / kLanes;  ///< of lanes

/// A patch's pixels in the order of reading, filled up with zeros to whole lanes.
using PatchValues = std::array<Lanes, kRows>;

TILEFLIGHT_LANE_INLINE void set(PatchValues& values, int pixel, float value) {
  values[pixel / kLanes][pixel % kLanes] = value;
}

/// Makes every pixel's value its distance from their mean; the filling stays zero.
TILEFLIGHT_LANE_INLINE void centre(PatchValues& values) {
  constexpr Lanes kLast{1};  // pixels in the last row of lanes
  static_assert(kPixels % kLanes == 1);
  Lanes sum{};
  for (const Lanes& row : values) sum += row;
  const float mean = lane_sum(sum) / kPixels;
  for (Lanes& row : values) row -= mean;
  values.back() *= kLast;
}

TILEFLIGHT_LANE_INLINE float product(const PatchValues& a, const PatchValues& b) {
  Lanes sum{};
  for (int i = 0; i < kRows; ++i) sum += a[i] * b[i];
  return lane_sum(sum);
}

/// The patch of one point at one level, with what the alignment needs of it.
struct Template {
  PatchValues value{};  ///< without their mean
  PatchValues gradient_x{};
  PatchValues gradient_y{};
  Matrix2f inverse_normal;
  float deviation = 0;
};

TILEFLIGHT_WIDE_VECTORS
bool make_template(const PyramidLevel& level, const Vector2f& center, Template& out) {
  if (!level.inside(center.x(), center.y(), kMargin_px)) return false;
  for (int k = 0; k < kPixels; ++k) {
    const Texel t = level.sample(center.x() + static_cast<float>(k % kSide - kRadius),
                                 center.y() + static_cast<float>(k / kSide - kRadius));
    set(out.value, k, t[kIntensity]);
    set(out.gradient_x, k, t[kGradX]);
    set(out.gradient_y, k, t[kGradY]);
  }
  centre(out.value);
  out.deviation = std::sqrt(product(out.value, out.value) / kPixels);
  const float xx = product(out.gradient_x, out.gradient_x), xy = product(out.gradient_x, out.gradient_y);
  const float yy = product(out.gradient_y, out.gradient_y);
  Matrix2f normal;
  normal << xx, xy, xy, yy;
  if (normal.determinant() < 1e-3F * normal.trace() * normal.trace() || out.deviation < 0.5F) return false;
  out.inverse_normal = normal.inverse();
  return true;
}

/// The patch's intensities about a position: one pair of weights for all, since they are whole pixels apart.
TILEFLIGHT_LANE_INLINE void sample_patch(const PyramidLevel& level, const Vector2f& center, PatchValues& out) {
  const int ix = static_cast<int>(center.x()), iy = static_cast<int>(center.y());
  const float dx = center.x() - static_cast<float>(ix), dy = center.y() - static_cast<float>(iy);
  std::array<float, kRows * kLanes> value{};
  for (int v = 0; v < kSide; ++v) {
    const float* top = level.row(iy + v - kRadius) + ix - kRadius;
    const float* bottom = top + level.width;
    for (const int u : {0, kSide - kLanes}) {  // the two overlap
      Lanes a, b, c, d;
      load_lanes(top + u, a), load_lanes(top + u + 1, b), load_lanes(bottom + u, c), load_lanes(bottom + u + 1, d);
      const Lanes above = a + dx * (b - a), below = c + dx * (d - c);
      store_lanes(above + dy * (below - above), value.data() + v * kSide + u);
    }
  }
  std::memcpy(out.data(), value.data(), sizeof(out));
}

/// Aligns from `guess`; false when it leaves the picture. `correlation`: normalised, of the last position.
TILEFLIGHT_WIDE_VECTORS
bool align_patch(const Template& patch, const PyramidLevel& to, Vector2f& position, float& correlation) {
  constexpr int kIterations = 15;
  PatchValues value;
  for (int i = 0; i < kIterations; ++i) {
    if (!to.inside(position.x(), position.y(), kMargin_px)) return false;
    sample_patch(to, position, value);
    centre(value);
    const float deviation = std::max(std::sqrt(product(value, value) / kPixels), 0.1F);
    const float gain = patch.deviation / deviation;
    Lanes bx{}, by{};
    for (int k = 0; k < kRows; ++k) {
      const Lanes difference = value[k] * gain - patch.value[k];
      bx += patch.gradient_x[k] * difference;
      by += patch.gradient_y[k] * difference;
    }
    correlation = product(value, patch.value) / (kPixels * deviation * patch.deviation);
    const Vector2f step = patch.inverse_normal * Vector2f(lane_sum(bx), lane_sum(by));
    position -= step;
    if (step.squaredNorm() < 1e-4F) break;
  }
  return true;
}

float scale_of(int level) { return 1.0F / static_cast<float>(1 << level); }
Vector2f at_level(const Vector2f& p, int level) {
  return (p + Vector2f::Constant(0.5F)) * scale_of(level) - Vector2f::Constant(0.5F);
}
Vector2f at_level0(const Vector2f& p, int level) {
  return (p + Vector2f::Constant(0.5F)) / scale_of(level) - Vector2f::Constant(0.5F);
}

std::optional<Vector2f> track_one(const Pyramid& from, const Pyramid& to, const Vector2f& point,
                                  const Vector2f& guess) {
  constexpr float kMinCorrelation = 0.85F;
  Vector2f position = guess;
  float correlation = 0;
  bool aligned = false;
  for (int l = static_cast<int>(from.levels.size()) - 1; l >= 0; --l) {
    Template patch;
    aligned = false;
    if (!make_template(from.levels[l], at_level(point, l), patch)) continue;
    Vector2f found = at_level(position, l);
    if (!align_patch(patch, to.levels[l], found, correlation)) continue;
    const Vector2f moved = at_level0(found, l);
    // A coarse level that fits nothing must not throw the finer ones off.
    if (l > 0 && correlation < 0.5F) continue;
    position = moved;
    aligned = true;
  }
  if (!aligned || correlation < kMinCorrelation) return std::nullopt;
  return position;
}

}  // namespace

std::vector<Vector2f> find_corners(const Pyramid& pyramid, const RayTable& rays, int wanted) {
  const PyramidLevel& level = pyramid.levels[0];
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

std::vector<std::optional<Vector2f>> track_corners(const Pyramid& from, const Pyramid& to,
                                                   const std::vector<Vector2f>& points) {
  constexpr float kMaxReturn_px = 0.5F;
  std::vector<std::optional<Vector2f>> tracked(points.size());
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, points.size(), 16), [&](const auto& range) {
    for (std::size_t i = range.begin(); i < range.end(); ++i) {
      const auto there = track_one(from, to, points[i], points[i]);
      if (!there) continue;
      const auto back = track_one(to, from, *there, points[i]);
      if (back && (*back - points[i]).norm() < kMaxReturn_px) tracked[i] = there;
    }
  });
  return tracked;
}

}  // namespace tileflight::odometry
