#include "tileflight/tiles/tile_writer/leaf_content.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <numeric>
#include <unordered_map>

#include "tileflight/core/imaging/rectangle_packing.h"

namespace tileflight::tile_writer {
namespace {

using geometry::Triangle;
using imaging::TexturedMesh;

/// Margin around a window for filtering, texels.
constexpr int kMargin_px = 1;

/// Fill factor of atlases, with windows and the gaps between them.
constexpr double kAtlasFill = 0.6;

/// Texels that a triangle with vertex colours or a plain colour counts for.
constexpr double kTexelsOfColors = 2.0;

constexpr int kMaxDepth = 9;

/// A rectangle of texels of an image; it may extend beyond the edges.
struct TexelWindow {
  std::int64_t x = 0, y = 0;           ///< top left texel
  std::int64_t width = 0, height = 0;  ///< texels

  std::int64_t area() const { return width * height; }
};

/// Windows, some of which were merged.
struct MergedWindows {
  std::vector<TexelWindow> windows;
  std::vector<std::size_t> merged_index;  ///< for each input window, the index of the one that contains it
};

/// Returns the smallest window that contains both.
TexelWindow bounding_window(const TexelWindow& a, const TexelWindow& b) {
  TexelWindow out{std::min(a.x, b.x), std::min(a.y, b.y), 0, 0};
  out.width = std::max(a.x + a.width, b.x + b.width) - out.x;
  out.height = std::max(a.y + a.height, b.y + b.height) - out.y;
  return out;
}

/// Merges windows whose bounding window is no larger than both together.
MergedWindows merge_overlapping(const std::vector<TexelWindow>& windows) {
  std::vector<std::size_t> order(windows.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return windows[a].x < windows[b].x; });
  MergedWindows out;
  out.merged_index.resize(windows.size());
  // Windows are sorted from left to right; those that end before the next one begins cannot grow any more.
  std::vector<std::size_t> open;
  for (const std::size_t i : order) {
    const TexelWindow& next = windows[i];
    std::erase_if(open, [&](std::size_t w) { return out.windows[w].x + out.windows[w].width <= next.x; });
    const auto joinable = std::find_if(open.begin(), open.end(), [&](std::size_t w) {
      return bounding_window(out.windows[w], next).area() <= out.windows[w].area() + next.area();
    });
    if (joinable == open.end()) {
      open.push_back(out.windows.size());
      out.merged_index[i] = out.windows.size();
      out.windows.push_back(next);
    } else {
      out.windows[*joinable] = bounding_window(out.windows[*joinable], next);
      out.merged_index[i] = *joinable;
    }
  }
  return out;
}

/// Texels of `from` sampled for pixel `i` of `to` along an axis: at most eight, evenly spread.
struct Samples {
  std::array<std::int64_t, 8> at{};
  int count = 0;
};

Samples samples_of(std::int64_t i, std::int64_t to, std::int64_t from) {
  const std::int64_t begin = i * from / to, end = std::max(begin + 1, (i + 1) * from / to);
  Samples out;
  out.count = static_cast<int>(std::min<std::int64_t>(8, end - begin));
  for (int k = 0; k < out.count; ++k)
    out.at[static_cast<std::size_t>(k)] = begin + (2 * k + 1) * (end - begin) / (2 * out.count);
  return out;
}

imaging::Rgb8 fetch_wrapped(const imaging::TexturedMesh& mesh, const mesh_files::TexelFetcher& fetch, std::int64_t x,
                            std::int64_t y) {
  const imaging::RgbImage& image = *mesh.texture;
  return fetch(image, static_cast<int>(imaging::wrapped_index(x, image.width, mesh.wrap_u)),
               static_cast<int>(imaging::wrapped_index(y, image.height, mesh.wrap_v)));
}

imaging::Rgb8 mean(const imaging::TexturedMesh& mesh, const mesh_files::TexelFetcher& fetch, const TexelWindow& window,
                   const Samples& across, const Samples& down) {
  std::array<int, 3> sum{};
  for (int j = 0; j < down.count; ++j)
    for (int i = 0; i < across.count; ++i) {
      const imaging::Rgb8 texel = fetch_wrapped(mesh, fetch, window.x + across.at[static_cast<std::size_t>(i)],
                                                window.y + down.at[static_cast<std::size_t>(j)]);
      for (std::size_t c = 0; c < 3; ++c) sum[c] += texel[c];
    }
  const int count = across.count * down.count;
  imaging::Rgb8 out{};
  for (std::size_t c = 0; c < 3; ++c) out[c] = static_cast<std::uint8_t>((sum[c] + count / 2) / count);
  return out;
}

/// Draws a window of a mesh's texture into an atlas: a copy if `size` is the window's, otherwise area-averaged.
void draw_window(const imaging::TexturedMesh& mesh, const mesh_files::TexelFetcher& fetch, const TexelWindow& window,
                 imaging::PixelPosition at, imaging::PixelSize size, imaging::RgbImage& sheet) {
  const bool as_it_is = size.width == window.width && size.height == window.height;
  for (int y = 0; y < size.height; ++y) {
    imaging::Rgb8* row = sheet.row(at.y + y) + at.x;
    const Samples down = samples_of(y, size.height, window.height);
    for (int x = 0; x < size.width; ++x)
      row[x] = as_it_is ? fetch_wrapped(mesh, fetch, window.x + x, window.y + y)
                        : mean(mesh, fetch, window, samples_of(x, size.width, window.width), down);
  }
}

/// A mesh with a subset of its triangles and the vertices they use.
TexturedMesh part_of(const TexturedMesh& mesh, const std::vector<std::size_t>& triangles) {
  TexturedMesh out;
  out.texture = mesh.uv.empty() ? nullptr : mesh.texture;
  out.wrap_u = mesh.wrap_u;
  out.wrap_v = mesh.wrap_v;
  out.base_color = mesh.base_color;
  std::unordered_map<std::uint32_t, std::uint32_t> index_of;
  for (const std::size_t triangle : triangles) {
    Triangle t = mesh.mesh.triangles[triangle];
    for (std::uint32_t& corner : t) {
      const auto [at, is_new] = index_of.try_emplace(corner, static_cast<std::uint32_t>(out.mesh.vertices.size()));
      if (is_new) {
        out.mesh.vertices.push_back(mesh.mesh.vertices[corner]);
        if (out.texture) out.uv.push_back(mesh.uv[corner]);
        if (!mesh.colors.empty()) out.colors.push_back(mesh.colors[corner]);
      }
      corner = at->second;
    }
    out.mesh.triangles.push_back(t);
  }
  return out;
}

/// The chart of each vertex: vertices connected by triangles are on the same chart.
std::vector<std::size_t> find_charts(const geometry::TriangleMesh& mesh, std::size_t& count) {
  std::vector<std::size_t> parent(mesh.vertices.size());
  std::iota(parent.begin(), parent.end(), std::size_t{0});
  const auto root = [&](std::size_t i) {
    while (parent[i] != i) i = parent[i] = parent[parent[i]];
    return i;
  };
  for (const Triangle& t : mesh.triangles) {
    parent[root(t[1])] = root(t[0]);
    parent[root(t[2])] = root(t[0]);
  }
  std::vector<std::size_t> chart_of(parent.size()), chart_of_root(parent.size(), parent.size());
  count = 0;
  for (std::size_t i = 0; i < parent.size(); ++i) {
    std::size_t& chart = chart_of_root[root(i)];
    if (chart == parent.size()) chart = count++;
    chart_of[i] = chart;
  }
  return chart_of;
}

/// Texture coordinate in texels, clamped far outside any image.
Eigen::Vector2d texel_place(const TexturedMesh& mesh, std::size_t vertex) {
  constexpr double kFar = 1e8;
  const Eigen::Vector2d at =
      mesh.uv[vertex].cast<double>().cwiseProduct(Eigen::Vector2d(mesh.texture->width, mesh.texture->height));
  return at.cwiseMax(-kFar).cwiseMin(kFar);
}

/// The texels that bilinear filtering between these corners (texels) can reach, plus a margin.
TexelWindow window_of(const Eigen::AlignedBox2d& box) {
  const auto first = [](double low) { return static_cast<std::int64_t>(std::floor(low - 0.5)) - kMargin_px; };
  const auto last = [](double high) { return static_cast<std::int64_t>(std::floor(high - 0.5)) + 1 + kMargin_px; };
  const std::int64_t x = first(box.min().x()), y = first(box.min().y());
  return {x, y, last(box.max().x()) - x + 1, last(box.max().y()) - y + 1};
}

/// The windows of one part in the atlas.
struct PartWindows {
  std::vector<TexelWindow> windows;
  std::vector<std::size_t> window_of_vertex;
};

PartWindows windows_of(const TexturedMesh& part) {
  std::size_t charts = 0;
  const std::vector<std::size_t> chart_of = find_charts(part.mesh, charts);
  std::vector<Eigen::AlignedBox2d> boxes(charts);
  for (std::size_t i = 0; i < chart_of.size(); ++i) boxes[chart_of[i]].extend(texel_place(part, i));
  std::vector<TexelWindow> windows;
  for (const Eigen::AlignedBox2d& box : boxes) windows.push_back(window_of(box));
  MergedWindows joined = merge_overlapping(windows);
  PartWindows out{std::move(joined.windows), {}};
  for (const std::size_t chart : chart_of) out.window_of_vertex.push_back(joined.merged_index[chart]);
  return out;
}

/// Layout of the atlas: size and position of each window.
struct AtlasPlan {
  double scale = 1.0;
  std::vector<imaging::PixelSize> sizes;
  imaging::RectanglePacking packing;
};

AtlasPlan plan_at(const std::vector<TexelWindow>& windows, double scale, int max_atlas_px) {
  AtlasPlan plan{scale, {}, {}};
  const auto scaled = [&](std::int64_t length) {
    return static_cast<int>(
        std::clamp(std::ceil(static_cast<double>(length) * scale), 1.0, double{1.0 * max_atlas_px}));
  };
  for (const TexelWindow& w : windows) plan.sizes.push_back({scaled(w.width), scaled(w.height)});
  plan.packing = imaging::pack_rectangles(plan.sizes);
  return plan;
}

/// The largest scale that fits the atlas, at most the source's. If the windows do not fit even at one texel each, the
/// oversized plan is kept.
AtlasPlan plan_atlas(const std::vector<TexelWindow>& windows, int max_atlas_px) {
  double area = 0;
  for (const TexelWindow& w : windows) area += static_cast<double>(w.width) * static_cast<double>(w.height);
  AtlasPlan plan = plan_at(windows, std::min(1.0, max_atlas_px / std::sqrt(std::max(1.0, area))), max_atlas_px);
  for (int attempt = 0; attempt < 64; ++attempt) {
    if (std::max(plan.packing.size.width, plan.packing.size.height) <= max_atlas_px) break;
    plan = plan_at(windows, 0.93 * plan.scale, max_atlas_px);
  }
  return plan;
}

/// Maps a part's texture coordinates to the atlas. `first`: the part's first window in the plan.
void move_uv(const PartWindows& windows, const AtlasPlan& plan, std::size_t first, TexturedMesh& part) {
  const Eigen::Vector2d atlas(plan.packing.size.width, plan.packing.size.height);
  for (std::size_t i = 0; i < part.uv.size(); ++i) {
    const std::size_t own = windows.window_of_vertex[i], planned = first + own;
    const TexelWindow& w = windows.windows[own];
    const Eigen::Vector2d within =
        texel_place(part, i) - Eigen::Vector2d(static_cast<double>(w.x), static_cast<double>(w.y));
    const Eigen::Vector2d size(plan.sizes[planned].width, plan.sizes[planned].height);
    const Eigen::Vector2d whole(static_cast<double>(w.width), static_cast<double>(w.height));
    const Eigen::Vector2d corner(plan.packing.positions[planned].x, plan.packing.positions[planned].y);
    const Eigen::Vector2d uv = (corner + within.cwiseProduct(size).cwiseQuotient(whole)).cwiseQuotient(atlas);
    part.uv[i] = uv.cwiseMax(0.0).cwiseMin(1.0).cast<float>();
  }
}

/// One texture for all textured parts.
double pack_into_atlas(std::vector<TexturedMesh>& parts, int max_atlas_px, const mesh_files::TexelFetcher& fetch) {
  std::vector<PartWindows> windows(parts.size());
  std::vector<TexelWindow> all;
  for (std::size_t i = 0; i < parts.size(); ++i) {
    if (parts[i].texture) windows[i] = windows_of(parts[i]);
    all.insert(all.end(), windows[i].windows.begin(), windows[i].windows.end());
  }
  if (all.empty()) return 1.0;
  const AtlasPlan plan = plan_atlas(all, max_atlas_px);
  const auto atlas = std::make_shared<imaging::RgbImage>(plan.packing.size.width, plan.packing.size.height);
  std::size_t first = 0;
  for (std::size_t i = 0; i < parts.size(); ++i) {
    if (!parts[i].texture) continue;
    for (std::size_t w = 0; w < windows[i].windows.size(); ++w)
      draw_window(parts[i], fetch, windows[i].windows[w], plan.packing.positions[first + w], plan.sizes[first + w],
                  *atlas);
    move_uv(windows[i], plan, first, parts[i]);
    parts[i].texture = atlas;
    parts[i].wrap_u = parts[i].wrap_v = imaging::Wrap::kClampToEdge;
    first += windows[i].windows.size();
  }
  return plan.scale;
}

bool look_alike(const TexturedMesh& a, const TexturedMesh& b) {
  return a.texture == b.texture && a.colors.empty() == b.colors.empty() && a.base_color == b.base_color;
}

void append(const TexturedMesh& part, TexturedMesh& to) {
  const auto first = static_cast<std::uint32_t>(to.mesh.vertices.size());
  to.mesh.vertices.insert(to.mesh.vertices.end(), part.mesh.vertices.begin(), part.mesh.vertices.end());
  to.uv.insert(to.uv.end(), part.uv.begin(), part.uv.end());
  to.colors.insert(to.colors.end(), part.colors.begin(), part.colors.end());
  for (const Triangle& t : part.mesh.triangles) to.mesh.triangles.push_back({first + t[0], first + t[1], first + t[2]});
}

/// Merges parts that differ only in geometry.
std::vector<TexturedMesh> merged(std::vector<TexturedMesh> parts) {
  std::vector<TexturedMesh> out;
  for (TexturedMesh& part : parts) {
    const auto like = std::find_if(out.begin(), out.end(), [&](const TexturedMesh& m) { return look_alike(m, part); });
    if (like == out.end()) {
      out.push_back(std::move(part));
    } else {
      append(part, *like);
    }
  }
  return out;
}

}  // namespace

LeafMeasures::LeafMeasures(int tile_triangles, int max_atlas_px)
    : tile_triangles_(tile_triangles), atlas_texels_(kAtlasFill * max_atlas_px * max_atlas_px) {}

float LeafMeasures::add(double area_m2, const std::optional<double>& texels) {
  const double atlas_share = texels ? std::min(*texels, atlas_texels_) / atlas_texels_ : 0.0;
  const auto weight = static_cast<float>(1.0 / tile_triangles_ + atlas_share);
  ++triangles_;
  weight_ += static_cast<double>(weight);
  area_m2_ += area_m2;
  texels_ += texels.value_or(kTexelsOfColors);
  return weight;
}

double LeafMeasures::texel_m() const { return std::sqrt(area_m2_ / std::max(texels_, 1.0)); }

int LeafMeasures::depth(const std::optional<int>& levels) const {
  if (levels) return std::clamp(*levels - 1, 0, kMaxDepth);
  int depth = 0;
  while (depth < kMaxDepth && weight_ > std::pow(4.0, depth)) ++depth;
  return depth;
}

double texels_between(const std::array<Eigen::Vector2f, 3>& uv, int width_px, int height_px) {
  const Eigen::Vector2d a = (uv[1] - uv[0]).cast<double>(), b = (uv[2] - uv[0]).cast<double>();
  const double area = std::abs(a.x() * b.y() - a.y() * b.x()) / 2 * width_px * height_px;
  return area < 1e9 ? area : 1e9;
}

LeafContent build_leaf_content(const std::vector<TexturedMesh>& meshes,
                               const simplification::TriangleNumbering& numbers,
                               const std::vector<std::uint32_t>& triangles, int max_atlas_px,
                               const mesh_files::TexelFetcher& fetch) {
  std::vector<TexturedMesh> parts;
  for (std::size_t i = 0; i < triangles.size();) {
    const std::size_t mesh = numbers(triangles[i]).mesh;
    std::vector<std::size_t> own;
    for (; i < triangles.size() && numbers(triangles[i]).mesh == mesh; ++i)
      own.push_back(numbers(triangles[i]).triangle);
    parts.push_back(part_of(meshes[mesh], own));
  }
  const double scale = pack_into_atlas(parts, max_atlas_px, fetch);
  return {merged(std::move(parts)), scale};
}

}  // namespace tileflight::tile_writer
