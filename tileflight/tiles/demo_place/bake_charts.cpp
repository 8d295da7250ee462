#include "tileflight/tiles/demo_place/bake_charts.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <memory>

#include "tileflight/core/imaging/rectangle_packing.h"

namespace tileflight::demo_place {
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
