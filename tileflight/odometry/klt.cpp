#include "tileflight/odometry/klt.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>

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

/// The patch of one point at one level, with what the alignment needs of it.
struct Template {
  std::array<float, kPixels> value;
  std::array<Vector2f, kPixels> gradient;
  Matrix2f inverse_normal;
  float deviation = 0;
};

struct Moments {
  float mean = 0;
  float deviation = 0;
};

Moments moments(const std::array<float, kPixels>& values) {
  float sum = 0, squares = 0;
  for (const float v : values) sum += v;
  const float mean = sum / kPixels;
  for (const float v : values) squares += (v - mean) * (v - mean);
  return {mean, std::sqrt(squares / kPixels)};
}

bool make_template(const PyramidLevel& level, const Vector2f& center, Template& out) {
  if (!level.inside(center.x(), center.y(), kMargin_px)) return false;
  Matrix2f normal = Matrix2f::Zero();
  for (int k = 0; k < kPixels; ++k) {
    const Texel t = level.sample(center.x() + static_cast<float>(k % kSide - kRadius),
                                 center.y() + static_cast<float>(k / kSide - kRadius));
    out.value[k] = t[kIntensity];
    out.gradient[k] = {t[kGradX], t[kGradY]};
  }
  const Moments m = moments(out.value);
  for (int k = 0; k < kPixels; ++k) {
    out.value[k] -= m.mean;
    normal += out.gradient[k] * out.gradient[k].transpose();
  }
  out.deviation = m.deviation;
  if (normal.determinant() < 1e-3F * normal.trace() * normal.trace() || m.deviation < 0.5F) return false;
  out.inverse_normal = normal.inverse();
  return true;
}

/// The patch's intensities about a position: one pair of weights for all, since they are whole pixels apart.
void sample_patch(const PyramidLevel& level, const Vector2f& center, std::array<float, kPixels>& value) {
  const int ix = static_cast<int>(center.x()), iy = static_cast<int>(center.y());
  const float dx = center.x() - static_cast<float>(ix), dy = center.y() - static_cast<float>(iy);
  for (int v = 0; v < kSide; ++v) {
    const float* top = level.row(iy + v - kRadius) + ix - kRadius;
    const float* bottom = top + level.width;
    for (int u = 0; u < kSide; ++u) {
      const float above = top[u] + dx * (top[u + 1] - top[u]), below = bottom[u] + dx * (bottom[u + 1] - bottom[u]);
      value[v * kSide + u] = above + dy * (below - above);
    }
  }
}

/// Aligns from `guess`; nullopt when it leaves the picture. `correlation`: normalised, of the last position.
std::optional<Vector2f> align_patch(const Template& patch, const PyramidLevel& to, Vector2f position,
                                    float& correlation) {
  constexpr int kIterations = 15;
  std::array<float, kPixels> value;
  for (int i = 0; i < kIterations; ++i) {
    if (!to.inside(position.x(), position.y(), kMargin_px)) return std::nullopt;
    sample_patch(to, position, value);
    const Moments m = moments(value);
    const float gain = patch.deviation / std::max(m.deviation, 0.1F);
    Vector2f b = Vector2f::Zero();
    float product = 0;
    for (int k = 0; k < kPixels; ++k) {
      const float centred = value[k] - m.mean;
      b += patch.gradient[k] * (centred * gain - patch.value[k]);
      product += centred * patch.value[k];
    }
    correlation = product / (kPixels * std::max(m.deviation, 0.1F) * patch.deviation);
    const Vector2f step = patch.inverse_normal * b;
    position -= step;
    if (step.squaredNorm() < 1e-4F) break;
  }
  return position;
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
    const auto found = align_patch(patch, to.levels[l], at_level(position, l), correlation);
    if (!found) continue;
    const Vector2f moved = at_level0(*found, l);
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
