#include "tileflight/tiles/demo_place/bake_charts.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>

#include "tileflight/core/geometry/polygon.h"
#include "tileflight/core/imaging/rectangle_packing.h"

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

namespace {

/// Pixels painted beyond a chart's edge, so that filtering and coarser mip levels do not mix in neighbouring charts.
constexpr int kChartGutter_px = 3;

/// A chart's rectangle in the texture, without its gutter.
struct Slot {
  int x = 0, y = 0, width = 0, height = 0;
};

Slot slot_size(const Chart& chart, double texture_scale) {
  const double per_m = texture_scale / chart.texel_m;
  const auto texels = [&](double length_m) {
    return std::max(2, static_cast<int>(std::ceil(length_m * per_m - 1e-6)));
  };
  return {0, 0, texels(chart.s_m.back()), texels(chart.t_m.back())};
}

/// A single chart has no neighbours: its texture is the chart without gutter, so that terrain tiles meet without a
/// seam.
imaging::RectanglePacking place_slots(std::vector<Slot>& slots) {
  const int gutter = slots.size() == 1 ? 0 : kChartGutter_px;
  std::vector<imaging::PixelSize> sizes;
  for (const Slot& s : slots) sizes.push_back({s.width + 2 * gutter, s.height + 2 * gutter});
  imaging::RectanglePacking packing = imaging::pack_rectangles(sizes);
  for (std::size_t i = 0; i < slots.size(); ++i) {
    slots[i].x = packing.positions[i].x + gutter;
    slots[i].y = packing.positions[i].y + gutter;
  }
  return packing;
}

/// Index of the cell between knots that contains `place`, and the fraction within it (0..1).
std::pair<std::size_t, double> find_cell(const std::vector<double>& knots, double place) {
  const auto next = std::upper_bound(knots.begin() + 1, knots.end() - 1, place);
  const auto cell = static_cast<std::size_t>(next - knots.begin()) - 1;
  return {cell, (place - knots[cell]) / (knots[cell + 1] - knots[cell])};
}

Texel texel_at(const Chart& chart, double s_m, double t_m) {
  const auto [column, within_column] = find_cell(chart.s_m, s_m);
  const auto [row, within_row] = find_cell(chart.t_m, t_m);
  const double u = within_column, v = within_row;  // not every compiler lets a lambda catch structured bindings
  const std::size_t at = row * chart.columns() + column, above = at + chart.columns();
  const auto blend = [&](const std::vector<Vec3>& f) -> Vec3 {
    return (1 - v) * ((1 - u) * f[at] + u * f[at + 1]) + v * ((1 - u) * f[above] + u * f[above + 1]);
  };
  Texel texel{s_m, t_m, blend(chart.vertices), Vec3::UnitZ()};
  if (!chart.normals.empty()) {
    texel.normal = blend(chart.normals).normalized();
    return texel;
  }
  const auto& p = chart.vertices;
  const Vec3 along_s = (1 - v) * (p[at + 1] - p[at]) + v * (p[above + 1] - p[above]);
  const Vec3 along_t = (1 - u) * (p[above] - p[at]) + u * (p[above + 1] - p[at + 1]);
  const Vec3 normal = along_s.cross(along_t);
  if (normal.squaredNorm() > 0) texel.normal = normal.normalized();
  return texel;
}

imaging::Rgb8 encoded(const Color& color) {
  const auto byte = [](float v) { return static_cast<std::uint8_t>(std::clamp(v, 0.0F, 1.0F) * 255.0F + 0.5F); };
  return {byte(color[0]), byte(color[1]), byte(color[2])};
}

/// Paints one row of a slot (y may be in the gutter), including gutters. Edge colours extend into the gutter.
void paint_row(const Chart& chart, const Slot& slot, int y, int gutter, const Sunlight& sun,
               imaging::RgbImage& texture) {
  const int row = std::clamp(y, 0, slot.height - 1);
  const double t_m = chart.t_m.back() * (row + 0.5) / slot.height;
  imaging::Rgb8* pixels = texture.row(slot.y + y) + slot.x;
  for (int x = 0; x < slot.width; ++x) {
    const Texel texel = texel_at(chart, chart.s_m.back() * (x + 0.5) / slot.width, t_m);
    pixels[x] = encoded(chart.paint(texel) * sun.light_factor(texel.position, texel.normal));
  }
  std::fill(pixels - gutter, pixels, pixels[0]);
  std::fill(pixels + slot.width, pixels + slot.width + gutter, pixels[slot.width - 1]);
}

void paint(const Chart& chart, const Slot& slot, int gutter, const Sunlight& sun, imaging::RgbImage& texture) {
  for (int y = 0; y < slot.height; ++y) paint_row(chart, slot, y, gutter, sun, texture);
  const int left = slot.x - gutter, right = slot.x + slot.width + gutter;
  for (int y = 1; y <= gutter; ++y) {
    std::copy(texture.row(slot.y) + left, texture.row(slot.y) + right, texture.row(slot.y - y) + left);
    const int last = slot.y + slot.height - 1;
    std::copy(texture.row(last) + left, texture.row(last) + right, texture.row(last + y) + left);
  }
}

void add_triangle(std::uint32_t a, std::uint32_t b, std::uint32_t c, geometry::TriangleMesh& mesh) {
  const auto& p = mesh.vertices;
  if ((p[b] - p[a]).cross(p[c] - p[a]).squaredNorm() > 0) mesh.triangles.push_back({a, b, c});
}

void add_cells(const Chart& chart, std::uint32_t first, geometry::TriangleMesh& mesh) {
  const auto columns = static_cast<std::uint32_t>(chart.columns());
  for (std::uint32_t row = 0; row + 1 < chart.rows(); ++row) {
    for (std::uint32_t column = 0; column + 1 < columns; ++column) {
      if (!chart.hole.empty() && chart.hole[row * (columns - 1) + column]) continue;
      const std::uint32_t a = first + row * columns + column;
      add_triangle(a, a + 1, a + 1 + columns, mesh);
      add_triangle(a, a + 1 + columns, a + columns, mesh);
    }
  }
}

void add_chart(const Chart& chart, const Slot& slot, imaging::PixelSize sheet, imaging::TexturedMesh& out) {
  const auto first = static_cast<std::uint32_t>(out.mesh.vertices.size());
  for (std::size_t row = 0; row < chart.rows(); ++row) {
    for (std::size_t column = 0; column < chart.columns(); ++column) {
      out.mesh.vertices.push_back(chart.vertex(column, row));
      const double u = (slot.x + chart.s_m[column] / chart.s_m.back() * slot.width) / sheet.width;
      const double v = (slot.y + chart.t_m[row] / chart.t_m.back() * slot.height) / sheet.height;
      out.uv.emplace_back(static_cast<float>(u), static_cast<float>(v));
    }
  }
  add_cells(chart, first, out.mesh);
}

}  // namespace

imaging::TexturedMesh bake_charts(const std::vector<const Chart*>& charts, const Sunlight& sun, double texture_scale) {
  imaging::TexturedMesh out;
  out.wrap_u = out.wrap_v = imaging::Wrap::kClampToEdge;
  if (charts.empty()) return out;
  std::vector<Slot> slots;
  for (const Chart* chart : charts) slots.push_back(slot_size(*chart, texture_scale));
  const imaging::RectanglePacking packing = place_slots(slots);
  const int gutter = charts.size() == 1 ? 0 : kChartGutter_px;
  const auto texture = std::make_shared<imaging::RgbImage>(packing.size.width, packing.size.height);
  tbb::parallel_for(std::size_t{0}, charts.size(),
                    [&](std::size_t i) { paint(*charts[i], slots[i], gutter, sun, *texture); });
  for (std::size_t i = 0; i < charts.size(); ++i) add_chart(*charts[i], slots[i], packing.size, out);
  out.texture = texture;
  return out;
}

}  // namespace tileflight::demo_place
