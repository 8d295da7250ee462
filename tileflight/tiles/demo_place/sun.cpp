#include "tileflight/tiles/demo_place/sun.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "tileflight/core/geometry/polygon.h"

namespace tileflight::demo_place {
namespace {

constexpr double kNormalOffset_m = 0.25;  ///< offset of the shadow test from the surface, to avoid self-shadowing
constexpr float kDepthBias_m = 0.25F;

template <class Visit>
void for_each_triangle(const Chart& chart, const Visit& visit) {
  for (std::size_t row = 0; row + 1 < chart.rows(); ++row) {
    for (std::size_t column = 0; column + 1 < chart.columns(); ++column) {
      if (!chart.hole.empty() && chart.hole[row * (chart.columns() - 1) + column]) continue;
      const Vec3 &a = chart.vertex(column, row), &b = chart.vertex(column + 1, row);
      const Vec3 &c = chart.vertex(column + 1, row + 1), &d = chart.vertex(column, row + 1);
      visit(a, b, c);
      visit(a, c, d);
    }
  }
}

}  // namespace

Sunlight::Sunlight(const Vec3& toward_sun, const std::vector<Chart>& charts, double cell_m)
    : toward_sun_(toward_sun.normalized()), cell_m_(cell_m) {
  axis_u_ = toward_sun_.unitOrthogonal();
  axis_v_ = toward_sun_.cross(axis_u_);
  Vec2 high = Vec2::Constant(-std::numeric_limits<double>::infinity());
  low_ = -high;
  for (const Chart& chart : charts) {
    for (const Vec3& p : chart.vertices) {
      const Vec2 uv(axis_u_.dot(p), axis_v_.dot(p));
      low_ = low_.cwiseMin(uv);
      high = high.cwiseMax(uv);
    }
  }
  width_ = static_cast<int>((high.x() - low_.x()) / cell_m_) + 2;
  height_ = static_cast<int>((high.y() - low_.y()) / cell_m_) + 2;
  depth_m_.assign(static_cast<std::size_t>(width_) * height_, -std::numeric_limits<float>::infinity());
  for (const Chart& chart : charts)
    for_each_triangle(chart, [&](const Vec3& a, const Vec3& b, const Vec3& c) { rasterize_shadow(a, b, c); });
}

Vec3 Sunlight::to_shadow_map(const Vec3& p) const {
  return {(axis_u_.dot(p) - low_.x()) / cell_m_, (axis_v_.dot(p) - low_.y()) / cell_m_, toward_sun_.dot(p)};
}

void Sunlight::rasterize_shadow(const Vec3& a_site, const Vec3& b_site, const Vec3& c_site) {
  const Vec3 a = to_shadow_map(a_site), b = to_shadow_map(b_site), c = to_shadow_map(c_site);
  const double area = geometry::twice_area_xy(a, b, c);
  if (std::fabs(area) < 1e-12) return;
  const int x0 = static_cast<int>(std::min({a.x(), b.x(), c.x()})),
            y0 = static_cast<int>(std::min({a.y(), b.y(), c.y()}));
  const int x1 = static_cast<int>(std::max({a.x(), b.x(), c.x()})),
            y1 = static_cast<int>(std::max({a.y(), b.y(), c.y()}));
  for (int y = y0; y <= y1; ++y) {
    for (int x = x0; x <= x1; ++x) {
      const Vec3 p(x + 0.5, y + 0.5, 0);
      const double wa = geometry::twice_area_xy(p, b, c) / area, wb = geometry::twice_area_xy(a, p, c) / area,
                   wc = 1.0 - wa - wb;
      if (wa < 0 || wb < 0 || wc < 0) continue;
      float& depth = depth_m_[static_cast<std::size_t>(y) * width_ + x];
      depth = std::max(depth, static_cast<float>(wa * a.z() + wb * b.z() + wc * c.z()));
    }
  }
}

float Sunlight::lit_share(const Vec3& position) const {
  const Vec3 p = to_shadow_map(position);
  const double x = std::clamp(p.x() - 0.5, 0.0, width_ - 1.001), y = std::clamp(p.y() - 0.5, 0.0, height_ - 1.001);
  const int ix = static_cast<int>(x), iy = static_cast<int>(y);
  const float* cell =
      &depth_m_[static_cast<std::size_t>(std::min(iy, height_ - 2)) * width_ + std::min(ix, width_ - 2)];
  const float limit = static_cast<float>(p.z()) + kDepthBias_m;
  const auto lit = [&](int offset) { return cell[offset] <= limit ? 1.0F : 0.0F; };
  const float u = static_cast<float>(x - ix), v = static_cast<float>(y - iy);
  return (1 - v) * ((1 - u) * lit(0) + u * lit(1)) + v * ((1 - u) * lit(width_) + u * lit(width_ + 1));
}

float Sunlight::light_factor(const Vec3& position, const Vec3& normal) const {
  const float facing = static_cast<float>(std::max(0.0, normal.dot(toward_sun_)));
  const float sky = 0.40F + 0.08F * static_cast<float>(normal.z());
  if (facing <= 0.0F) return sky;
  return sky + 0.72F * facing * lit_share(position + kNormalOffset_m * normal);
}

}  // namespace tileflight::demo_place
