// A place of hills in two textured materials and one coloured by vertex, and what tests of its tiles ask of it.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <map>
#include <memory>
#include <vector>

#include "tileflight/core/base/srgb.h"
#include "tileflight/core/geometry/triangle_index.h"
#include "tileflight/core/imaging/textured_mesh.h"
#include "tileflight/tiles/simplification/simplify.h"
#include "tileflight/tiles/tileset/load.h"

namespace tileflight::tile_writer::test_hills {

using geometry::Triangle;
using geometry::Vec3;
using imaging::RgbImage;
using imaging::TexturedMesh;

inline constexpr int kSheets = 4, kCells = 12;  ///< sheets along a side of the site, cells along a side of a sheet
inline constexpr double kEdge_m = 20.0;
inline constexpr int kSlot_px = 128, kInset_px = 4;  ///< square of a sheet in its atlas, and its unused border

/// Heights that are exact in floats, so that surfaces can be compared exactly.
inline double height(double x, double y) {
  const double z = 2.0 * std::sin(0.11 * x) + 1.3 * std::cos(0.17 * y) + 0.4 * std::sin(0.9 * x) * std::sin(0.7 * y);
  return std::round(64 * z) / 64;
}

/// Colour of the site, sRGB.
inline std::array<double, 3> color(double x, double y) {
  return {128 + 80 * std::sin(0.09 * x), 128 + 80 * std::cos(0.11 * y), 128 + 60 * std::sin(0.05 * (x + y))};
}

/// Sheet (i, j) in slot `slot` of an atlas of `columns` columns; odd slots are rotated by 90 degrees.
struct Slot {
  int column = 0, row = 0;
  bool turned = false;
  double x0 = 0, y0 = 0;

  Slot(int slot, int columns, int i, int j)
      : column(slot % columns),
        row(slot / columns),
        turned(slot % 2 == 1),
        x0(kEdge_m * (i - kSheets / 2)),
        y0(kEdge_m * (j - kSheets / 2)) {}

  /// Atlas texel of a position in the site.
  Eigen::Vector2d texel(double x, double y) const {
    const double s = (x - x0) / kEdge_m, t = (y - y0) / kEdge_m, inner = kSlot_px - 2 * kInset_px;
    return {column * kSlot_px + kInset_px + inner * (turned ? t : s),
            row * kSlot_px + kInset_px + inner * (turned ? s : t)};
  }
  void paint(RgbImage& atlas) const {
    for (int b = 0; b < kSlot_px; ++b)
      for (int a = 0; a < kSlot_px; ++a) {
        const double along = (a + 0.5 - kInset_px) / (kSlot_px - 2 * kInset_px);
        const double down = (b + 0.5 - kInset_px) / (kSlot_px - 2 * kInset_px);
        const auto c = color(x0 + kEdge_m * (turned ? down : along), y0 + kEdge_m * (turned ? along : down));
        atlas(column * kSlot_px + a, row * kSlot_px + b) = {
            static_cast<std::uint8_t>(c[0]), static_cast<std::uint8_t>(c[1]), static_cast<std::uint8_t>(c[2])};
      }
  }
};

void add_vertex(double x, double y, TexturedMesh& mesh) { mesh.mesh.vertices.emplace_back(x, y, height(x, y)); }

/// Appends one sheet of hills; `attribute(x, y)` is called for each vertex.
template <class Attribute>
inline void add_sheet(int i, int j, TexturedMesh& mesh, const Attribute& attribute) {
  const auto first = static_cast<std::uint32_t>(mesh.mesh.vertices.size());
  constexpr std::uint32_t kRow = kCells + 1;
  for (std::uint32_t b = 0; b < kRow; ++b)
    for (std::uint32_t a = 0; a < kRow; ++a) {
      // Steps of 20 / 12 m are no dyadic numbers: rounded to 1/64 m, the same from either side.
      const auto place = [](int sheet, std::uint32_t step) {
        return std::round(64 * kEdge_m * (sheet - kSheets / 2 + static_cast<double>(step) / kCells)) / 64;
      };
      add_vertex(place(i, a), place(j, b), mesh);
      attribute(mesh.mesh.vertices.back().x(), mesh.mesh.vertices.back().y());
      if (a == kCells || b == kCells) continue;
      const std::uint32_t at = first + b * kRow + a;
      mesh.mesh.triangles.push_back({at, at + 1, at + 1 + kRow});
      mesh.mesh.triangles.push_back({at, at + 1 + kRow, at + kRow});
    }
}

/// Rows `from` to `to` of sheets on one atlas whose unused parts are magenta. `shift`: integer offset of the texture
/// coordinates (whole repeats).
inline TexturedMesh textured_rows(int from, int to, float shift) {
  TexturedMesh mesh;
  const auto atlas = std::make_shared<RgbImage>(3 * kSlot_px, 3 * kSlot_px, imaging::Rgb8{255, 0, 255});
  for (int j = from; j < to; ++j)
    for (int i = 0; i < kSheets; ++i) {
      const Slot slot((j - from) * kSheets + i, 3, i, j);
      slot.paint(*atlas);
      add_sheet(i, j, mesh, [&](double x, double y) {
        const Eigen::Vector2d texel = slot.texel(x, y) / (3.0 * kSlot_px);
        mesh.uv.emplace_back(static_cast<float>(texel.x()) + shift, static_cast<float>(texel.y()));
      });
    }
  mesh.texture = atlas;
  return mesh;
}

/// 80 m x 80 m around the origin: two textured materials and one row coloured by vertex.
inline std::vector<TexturedMesh> make_place() {
  TexturedMesh colored;
  for (int i = 0; i < kSheets; ++i)
    add_sheet(i, 3, colored, [&](double x, double y) {
      const auto c = color(x, y);
      colored.colors.push_back(base::linear_rgba_from_srgb(
          {static_cast<float>(c[0] / 255), static_cast<float>(c[1] / 255), static_cast<float>(c[2] / 255)}));
    });
  return {textured_rows(0, 2, 0.0F), textured_rows(2, 3, 1.0F), colored};
}

inline tileset::LoadedTiles load(const std::filesystem::path& folder, double error_m) {
  tileset::LoadOptions options;
  options.error_m = error_m;
  return tileset::load_region(folder.string(), options);
}

/// Positions of each triangle's corners, starting at the smallest: equal lists mean equal surfaces, winding included.
inline std::vector<std::array<double, 9>> places_of(const geometry::TriangleMesh& mesh) {
  std::vector<std::array<double, 9>> out;
  for (const Triangle& t : mesh.triangles) {
    std::array<std::array<double, 9>, 3> turns{};
    for (std::size_t turn = 0; turn < 3; ++turn)
      for (std::size_t k = 0; k < 9; ++k)
        turns[turn][k] = mesh.vertices[t[(turn + k / 3) % 3]][static_cast<Eigen::Index>(k % 3)];
    out.push_back(*std::min_element(turns.begin(), turns.end()));
  }
  std::sort(out.begin(), out.end());
  return out;
}

/// Largest distance of sampled points of `from` (corners, and points within each triangle) to `to`.
inline double sampled_distance_m(const geometry::TriangleMesh& from, const geometry::TriangleMesh& to) {
  const geometry::TriangleIndex index(to);
  double farthest_m = 0;
  for (const Triangle& t : from.triangles)
    for (int i = 0; i <= 4; ++i)
      for (int j = 0; i + j <= 4; ++j) {
        const Vec3 &a = from.vertices[t[0]], &b = from.vertices[t[1]], &c = from.vertices[t[2]];
        farthest_m = std::max(farthest_m, index.nearest(a + (b - a) * i / 4 + (c - a) * j / 4)->distance_m);
      }
  return farthest_m;
}

/// Displayed colour of a mesh at a point of a triangle: texel, or vertex colours.
inline std::array<double, 3> shown(const TexturedMesh& mesh, const Triangle& t, const Vec3& weights) {
  std::array<double, 3> out{};
  if (!mesh.texture) {
    for (std::size_t c = 0; c < 3; ++c) {
      double linear = 0;
      for (std::size_t k = 0; k < 3; ++k)
        linear += weights[static_cast<Eigen::Index>(k)] * mesh.colors[t[k]][c] / 255.0;
      out[c] = 255.0 * static_cast<double>(base::srgb_from_linear(static_cast<float>(linear)));
    }
    return out;
  }
  Eigen::Vector2d uv = Eigen::Vector2d::Zero();
  for (std::size_t k = 0; k < 3; ++k) uv += weights[static_cast<Eigen::Index>(k)] * mesh.uv[t[k]].cast<double>();
  const imaging::Rgb8 texel =
      (*mesh.texture)(std::min(mesh.texture->width - 1, static_cast<int>(uv.x() * mesh.texture->width)),
                      std::min(mesh.texture->height - 1, static_cast<int>(uv.y() * mesh.texture->height)));
  for (std::size_t c = 0; c < 3; ++c) out[c] = texel[c];
  return out;
}

/// Largest and mean difference, in grey levels, between the displayed colours and those of the site.
struct ColorDifference {
  double largest = 0, mean = 0;
};
inline ColorDifference color_difference(const std::vector<TexturedMesh>& meshes) {
  ColorDifference out;
  double sum = 0;
  int count = 0;
  const std::array<Vec3, 4> weights{Vec3(1, 1, 1) / 3, Vec3(0.98, 0.01, 0.01), Vec3(0.01, 0.98, 0.01),
                                    Vec3(0.01, 0.01, 0.98)};
  for (const TexturedMesh& mesh : meshes)
    for (const Triangle& t : mesh.mesh.triangles)
      for (const Vec3& w : weights) {
        const auto& v = mesh.mesh.vertices;
        const Vec3 place = w[0] * v[t[0]] + w[1] * v[t[1]] + w[2] * v[t[2]];
        const auto is = shown(mesh, t, w), truth = color(place.x(), place.y());
        for (std::size_t c = 0; c < 3; ++c) {
          out.largest = std::max(out.largest, std::fabs(is[c] - truth[c]));
          sum += std::fabs(is[c] - truth[c]);
          ++count;
        }
      }
  out.mean = sum / count;
  return out;
}

/// Number of triangles that use each edge, by the positions of its ends.
inline std::map<std::array<double, 6>, int> edge_uses(const geometry::TriangleMesh& mesh) {
  std::map<std::array<double, 6>, int> uses;
  for (const Triangle& t : mesh.triangles)
    for (std::size_t k = 0; k < 3; ++k) {
      Vec3 a = mesh.vertices[t[k]], b = mesh.vertices[t[(k + 1) % 3]];
      if (std::lexicographical_compare(b.begin(), b.end(), a.begin(), a.end())) std::swap(a, b);
      ++uses[{a.x(), a.y(), a.z(), b.x(), b.y(), b.z()}];
    }
  return uses;
}

}  // namespace tileflight::tile_writer::test_hills
