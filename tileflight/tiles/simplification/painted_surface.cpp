#include "tileflight/tiles/simplification/painted_surface.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <limits>
#include <memory>
#include <numeric>
#include <unordered_map>
#include <vector>

#include "tileflight/core/base/srgb.h"
#include "tileflight/core/imaging/deferred_texture.h"
#include "tileflight/core/imaging/rectangle_packing.h"

// Notation: a chart is a connected set of triangles of one facing; (s, t) are metres on its plane; a slot is its
// rectangle in the atlas, including a gutter of kGutter_px around it.

namespace tileflight::simplification {
namespace {

using geometry::Triangle;
using geometry::Vec3;
using imaging::TexturedMesh;

geometry::TriangleMesh joined(const std::vector<const TexturedMesh*>& meshes) {
  geometry::TriangleMesh out;
  for (const TexturedMesh* m : meshes) {
    const auto first = static_cast<std::uint32_t>(out.vertices.size());
    out.vertices.insert(out.vertices.end(), m->mesh.vertices.begin(), m->mesh.vertices.end());
    for (const Triangle& t : m->mesh.triangles) out.triangles.push_back({first + t[0], first + t[1], first + t[2]});
  }
  return out;
}

/// Barycentric weights of a point of a triangle, by areas; for a degenerate triangle, its first corner.
std::array<double, 3> weights_at(const Vec3& p, const Vec3& a, const Vec3& b, const Vec3& c) {
  const Vec3 normal = (b - a).cross(c - a);
  const double area2 = normal.squaredNorm();
  if (!(area2 > 0)) return {1, 0, 0};
  const double wb = std::clamp((p - a).cross(c - a).dot(normal) / area2, 0.0, 1.0);
  const double wc = std::clamp((b - a).cross(p - a).dot(normal) / area2, 0.0, 1.0 - wb);
  return {1 - wb - wc, wb, wc};
}

using TextureColor = std::array<double, 3>;  ///< sRGB, 0..255

imaging::Rgb8 wrapped_texel(const TexturedMesh& mesh, const imaging::RgbImage& image, std::int64_t x, std::int64_t y) {
  return image(static_cast<int>(imaging::wrapped_index(x, image.width, mesh.wrap_u)),
               static_cast<int>(imaging::wrapped_index(y, image.height, mesh.wrap_v)));
}

/// Bilinear interpolation at (x, y) in texels.
TextureColor bilinear(const TexturedMesh& mesh, const imaging::RgbImage& image, double x, double y) {
  const double left = std::floor(x - 0.5), top = std::floor(y - 0.5);
  const double across = x - 0.5 - left, down = y - 0.5 - top;
  const auto column = static_cast<std::int64_t>(left), row = static_cast<std::int64_t>(top);
  const std::array texels{wrapped_texel(mesh, image, column, row), wrapped_texel(mesh, image, column + 1, row),
                          wrapped_texel(mesh, image, column, row + 1), wrapped_texel(mesh, image, column + 1, row + 1)};
  const std::array weights{(1 - across) * (1 - down), across * (1 - down), (1 - across) * down, across * down};
  TextureColor out{};
  for (std::size_t k = 0; k < 4; ++k)
    for (std::size_t c = 0; c < 3; ++c) out[c] += weights[k] * texels[k][c];
  return out;
}

/// The texture at half resolution: a mean over two texels across and down.
TextureColor texture_color(const TexturedMesh& mesh, const imaging::RgbImage& image, const Triangle& t,
                           const std::array<double, 3>& weights) {
  Eigen::Vector2d uv = Eigen::Vector2d::Zero();
  for (std::size_t k = 0; k < 3; ++k) uv += weights[k] * mesh.uv[t[k]].cast<double>();
  constexpr double kFar = 1e8;
  const double x = std::clamp(uv.x() * image.width, -kFar, kFar);
  const double y = std::clamp(uv.y() * image.height, -kFar, kFar);
  TextureColor out{};
  for (const double dx : {-0.5, 0.5})
    for (const double dy : {-0.5, 0.5}) {
      const TextureColor tap = bilinear(mesh, image, x + dx, y + dy);
      for (std::size_t c = 0; c < 3; ++c) out[c] += tap[c] / 4;
    }
  return out;
}

/// Multiplies by vertex and base colours in linear light.
void tint(const TexturedMesh& mesh, const Triangle& t, const std::array<double, 3>& weights, TextureColor& color) {
  for (std::size_t c = 0; c < 3; ++c) {
    double factor = static_cast<double>(mesh.base_color[c]);
    if (!mesh.colors.empty()) {
      double own = 0;
      for (std::size_t k = 0; k < 3; ++k) own += weights[k] * mesh.colors[t[k]][c];
      factor *= own / 255;
    }
    if (factor == 1.0) continue;
    const float linear = base::linear_from_srgb(static_cast<float>(color[c] / 255)) * static_cast<float>(factor);
    color[c] = 255.0 * static_cast<double>(base::srgb_from_linear(std::clamp(linear, 0.0F, 1.0F)));
  }
}

}  // namespace

TriangleNumbering::TriangleNumbering(const std::vector<TexturedMesh>& meshes) {
  first_.push_back(0);
  for (const TexturedMesh& m : meshes)
    first_.push_back(first_.back() + static_cast<std::uint32_t>(m.mesh.triangles.size()));
}

TriangleNumbering::TriangleNumbering(const std::vector<const TexturedMesh*>& meshes) {
  first_.push_back(0);
  for (const TexturedMesh* m : meshes)
    first_.push_back(first_.back() + static_cast<std::uint32_t>(m->mesh.triangles.size()));
}

TriangleNumbering::TriangleRef TriangleNumbering::operator()(std::uint32_t number) const {
  const auto next = std::upper_bound(first_.begin(), first_.end(), number);
  const auto mesh = static_cast<std::size_t>(next - first_.begin()) - 1;
  return {mesh, number - first_[mesh]};
}

SurfaceColors::SurfaceColors(std::vector<const TexturedMesh*> meshes)
    : meshes_(std::move(meshes)), numbering_(meshes_), index_(joined(meshes_)) {}

double SurfaceColors::distance_m(std::uint32_t number, const Vec3& place) const {
  const TriangleNumbering::TriangleRef at = numbering_(number);
  const auto& v = meshes_[at.mesh]->mesh.vertices;
  const Triangle& t = meshes_[at.mesh]->mesh.triangles[at.triangle];
  return (place - geometry::closest_point_on_triangle(place, v[t[0]], v[t[1]], v[t[2]])).norm();
}

const std::shared_ptr<const imaging::RgbImage>& SurfaceColors::texture(std::uint32_t triangle) const {
  return meshes_[numbering_(triangle).mesh]->texture;
}

bool SurfaceColors::has_deferred_textures() const {
  return std::ranges::any_of(meshes_, [](const TexturedMesh* mesh) { return imaging::is_deferred(mesh->texture); });
}

imaging::Rgb8 SurfaceColors::color(std::uint32_t triangle, const Vec3& on_surface,
                                   const imaging::RgbImage* texture) const {
  const TriangleNumbering::TriangleRef at = numbering_(triangle);
  const TexturedMesh& mesh = *meshes_[at.mesh];
  const Triangle& t = mesh.mesh.triangles[at.triangle];
  const auto& v = mesh.mesh.vertices;
  const std::array<double, 3> weights = weights_at(on_surface, v[t[0]], v[t[1]], v[t[2]]);
  TextureColor color{255, 255, 255};
  if (texture != nullptr && !mesh.uv.empty()) color = texture_color(mesh, *texture, t, weights);
  tint(mesh, t, weights, color);
  imaging::Rgb8 out{};
  for (std::size_t c = 0; c < 3; ++c) out[c] = static_cast<std::uint8_t>(std::clamp(color[c] + 0.5, 0.0, 255.0));
  return out;
}

geometry::SurfacePoint SurfaceColors::CoherentSampler::nearest(const Vec3& place) {
  // Slightly more than the distance to some triangle: the nearest one is always within it.
  const double radius_m =
      has_last_ ? colors_.distance_m(last_, place) * (1 + 1e-6) + 1e-9 : std::numeric_limits<double>::infinity();
  const geometry::SurfacePoint nearest = *colors_.index_.nearest(place, radius_m);
  has_last_ = true;
  last_ = static_cast<std::uint32_t>(nearest.triangle);
  return nearest;
}

namespace {

using geometry::TriangleMesh;
using geometry::Vec2;

constexpr int kPaintGutter_px = 2;

/// Pixels of a slot that are painted together: what is kept of each takes 40 bytes.
constexpr std::int64_t kBandPixels = std::int64_t{1} << 20;

enum class Facing : std::uint8_t { kUp, kDown, kEast, kWest, kNorth, kSouth };
constexpr std::size_t kFacings = 6;

Facing facing_of(const TriangleMesh& mesh, const Triangle& t) {
  const Vec3 n = (mesh.vertices[t[1]] - mesh.vertices[t[0]]).cross(mesh.vertices[t[2]] - mesh.vertices[t[0]]);
  const double length = n.norm();
  if (n.z() >= 0.5 * length) return Facing::kUp;
  if (n.z() <= -0.7 * length) return Facing::kDown;
  if (std::abs(n.x()) >= std::abs(n.y())) return n.x() > 0 ? Facing::kEast : Facing::kWest;
  return n.y() > 0 ? Facing::kNorth : Facing::kSouth;
}

/// Position on the plane perpendicular to the facing's axis.
Vec2 flat(Facing facing, const Vec3& p) {
  if (facing == Facing::kUp || facing == Facing::kDown) return {p.x(), -p.y()};
  if (facing == Facing::kEast || facing == Facing::kWest) return {p.y(), -p.z()};
  return {p.x(), -p.z()};
}

/// Distance outwards along the facing's axis.
double outwards(Facing facing, const Vec3& p) {
  switch (facing) {
    case Facing::kUp:
      return p.z();
    case Facing::kDown:
      return -p.z();
    case Facing::kEast:
      return p.x();
    case Facing::kWest:
      return -p.x();
    case Facing::kNorth:
      return p.y();
    default:
      return -p.y();
  }
}

struct FlatChart {
  Facing facing = Facing::kUp;
  std::vector<std::uint32_t> triangles;
  Eigen::AlignedBox2d box;  ///< (s, t), metres
};

/// Connected sets of triangles of one facing, in order of their first triangle.
std::vector<FlatChart> find_charts(const TriangleMesh& mesh) {
  std::vector<Facing> facing;
  std::vector<std::uint32_t> parent(mesh.triangles.size());
  std::iota(parent.begin(), parent.end(), 0U);
  const auto root = [&](std::uint32_t i) {
    while (parent[i] != i) i = parent[i] = parent[parent[i]];
    return i;
  };
  std::unordered_map<std::uint64_t, std::uint32_t> user;  // by vertex and facing: the triangle that used it first
  for (std::uint32_t i = 0; i < mesh.triangles.size(); ++i) {
    facing.push_back(facing_of(mesh, mesh.triangles[i]));
    for (const std::uint32_t corner : mesh.triangles[i]) {
      const auto [at, is_new] =
          user.try_emplace(corner * std::uint64_t{kFacings} + static_cast<std::uint64_t>(facing[i]), i);
      if (!is_new) parent[std::max(root(i), root(at->second))] = std::min(root(i), root(at->second));
    }
  }
  std::vector<FlatChart> charts;
  std::unordered_map<std::uint32_t, std::size_t> chart_of_root;
  for (std::uint32_t i = 0; i < mesh.triangles.size(); ++i) {
    const auto [at, is_new] = chart_of_root.try_emplace(root(i), charts.size());
    if (is_new) charts.push_back({facing[i], {}, {}});
    FlatChart& chart = charts[at->second];
    chart.triangles.push_back(i);
    for (const std::uint32_t corner : mesh.triangles[i]) chart.box.extend(flat(chart.facing, mesh.vertices[corner]));
  }
  return charts;
}

/// Positions of all charts in the atlas.
struct ChartLayout {
  double texel_m = 0.0;
  std::vector<imaging::PixelSize> slots;
  imaging::RectanglePacking packing;

  /// Atlas pixel of a point on a chart, where pixel i covers i to i + 1.
  Vec2 pixel(const FlatChart& chart, std::size_t number, const Vec3& p) const {
    const imaging::PixelPosition at = packing.positions[number];
    return (flat(chart.facing, p) - chart.box.min()) / texel_m +
           Vec2(at.x + kPaintGutter_px + 0.5, at.y + kPaintGutter_px + 0.5);
  }
};

ChartLayout plan_at(const std::vector<FlatChart>& charts, double texel_m, int max_atlas_px) {
  ChartLayout plan{texel_m, {}, {}};
  const auto texels = [&](double length_m) {
    return static_cast<int>(std::min(std::ceil(length_m / texel_m), 2.0 * max_atlas_px)) + 1 + 2 * kPaintGutter_px;
  };
  for (const FlatChart& chart : charts)
    plan.slots.push_back({texels(chart.box.sizes().x()), texels(chart.box.sizes().y())});
  plan.packing = imaging::pack_rectangles(plan.slots);
  return plan;
}

ChartLayout plan_atlas(const std::vector<FlatChart>& charts, const PaintOptions& options) {
  ChartLayout plan = plan_at(charts, options.texel_m, options.max_atlas_px);
  for (int attempt = 0; attempt < 400; ++attempt) {
    if (std::max(plan.packing.size.width, plan.packing.size.height) <= options.max_atlas_px) break;
    plan = plan_at(charts, 1.08 * plan.texel_m, options.max_atlas_px);
  }
  return plan;
}

/// The triangle that paints a pixel of a slot, and the point that it shows.
struct TexelOwner {
  double distance_px = std::numeric_limits<double>::infinity();  ///< distance from the triangle; 0: inside
  double outwards_m = 0.0;
  Vec3 place = Vec3::Zero();  ///< the triangle's point nearest to the pixel
};

/// A texel of the sheet whose colour is still to be read.
struct UnpaintedTexel {
  static constexpr std::uint32_t kNoPixel = std::numeric_limits<std::uint32_t>::max();

  Vec3 place = Vec3::Zero();       ///< on the colours' surface
  std::uint32_t triangle = 0;      ///< of that surface
  std::uint32_t pixel = kNoPixel;  ///< in the sheet
};

/// Paints texture by texture: each is decoded once, and each thread holds one at a time.
void paint_by_texture(const SurfaceColors& colors, const std::vector<UnpaintedTexel>& texels,
                      imaging::RgbImage& sheet) {
  std::unordered_map<const imaging::RgbImage*, std::vector<std::uint32_t>> texels_of;
  for (std::uint32_t i = 0; i < texels.size(); ++i) texels_of[colors.texture(texels[i].triangle).get()].push_back(i);
  std::vector<const std::vector<std::uint32_t>*> groups;
  for (const auto& [texture, group] : texels_of) groups.push_back(&group);
  tbb::parallel_for(std::size_t{0}, groups.size(), [&](std::size_t k) {
    const std::shared_ptr<const imaging::RgbImage>& texture = colors.texture(texels[groups[k]->front()].triangle);
    const std::shared_ptr<const imaging::RgbImage> decoded = texture ? imaging::with_pixels(texture) : nullptr;
    for (const std::uint32_t i : *groups[k])
      sheet.pixels[texels[i].pixel] = colors.color(texels[i].triangle, texels[i].place, decoded.get());
  });
}

class SlotPainter {
 public:
  SlotPainter(const TriangleMesh& mesh, const ChartLayout& plan, const FlatChart& chart, std::size_t number)
      : mesh_(mesh), plan_(plan), chart_(chart), number_(number) {}

  /// `deferred`: takes the texels instead of painting them; null: paints them.
  void paint(const SurfaceColors& colors, imaging::RgbImage& sheet, imaging::GrayImage& is_painted,
             std::vector<UnpaintedTexel>* deferred) {
    const int rows = static_cast<int>(std::max<std::int64_t>(1, kBandPixels / size().width));
    for (first_row_ = 0; first_row_ < size().height; first_row_ = end_row_) {
      end_row_ = std::min(size().height, first_row_ + rows);
      owners_.assign(static_cast<std::size_t>(size().width) * static_cast<std::size_t>(end_row_ - first_row_), {});
      for (const std::uint32_t triangle : chart_.triangles) claim(mesh_.triangles[triangle]);
      if (deferred != nullptr)
        defer_band(colors, sheet, is_painted, *deferred);
      else
        paint_band(colors, sheet, is_painted);
    }
  }

 private:
  void paint_band(const SurfaceColors& colors, imaging::RgbImage& sheet, imaging::GrayImage& is_painted) const {
    const imaging::PixelPosition at = plan_.packing.positions[number_];
    for_each_texel(colors, [&](int x, int y, std::uint32_t triangle, const Vec3& place) {
      sheet(at.x + x, at.y + y) = colors.color(triangle, place, colors.texture(triangle).get());
      is_painted(at.x + x, at.y + y) = 1;
    });
  }

  void defer_band(const SurfaceColors& colors, const imaging::RgbImage& sheet, imaging::GrayImage& is_painted,
                  std::vector<UnpaintedTexel>& deferred) const {
    const imaging::PixelPosition at = plan_.packing.positions[number_];
    std::vector<UnpaintedTexel> band(owners_.size());
    for_each_texel(colors, [&](int x, int y, std::uint32_t triangle, const Vec3& place) {
      const auto pixel = static_cast<std::uint32_t>((at.y + y) * sheet.width + at.x + x);
      band[index(x, y)] = {place, triangle, pixel};
      is_painted(at.x + x, at.y + y) = 1;
    });
    std::ranges::copy_if(band, std::back_inserter(deferred),
                         [](const UnpaintedTexel& texel) { return texel.pixel != UnpaintedTexel::kNoPixel; });
  }

  /// Calls `take(x, y, triangle, place)` with the nearest point of the colours' surface, for each pixel of the band
  /// that shows a triangle, in parallel.
  template <class Take>
  void for_each_texel(const SurfaceColors& colors, const Take& take) const {
    tbb::parallel_for(first_row_, end_row_, [&](int y) {
      SurfaceColors::CoherentSampler walk(colors);
      for (int x = 0; x < size().width; ++x) {
        const TexelOwner& owner = owners_[index(x, y)];
        if (owner.distance_px > kPaintGutter_px) continue;
        const geometry::SurfacePoint nearest = walk.nearest(owner.place);
        take(x, y, static_cast<std::uint32_t>(nearest.triangle), nearest.position);
      }
    });
  }

  imaging::PixelSize size() const { return plan_.slots[number_]; }
  std::size_t index(int x, int y) const {
    return static_cast<std::size_t>(y - first_row_) * static_cast<std::size_t>(size().width) +
           static_cast<std::size_t>(x);
  }

  /// Offers the triangle to all pixels within a gutter's width of it.
  void claim(const Triangle& t) {
    const imaging::PixelPosition at = plan_.packing.positions[number_];
    std::array<Vec3, 3> corners;
    Eigen::AlignedBox2d box;
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec2 p = plan_.pixel(chart_, number_, mesh_.vertices[t[k]]) - Vec2(at.x, at.y);
      corners[k] = {p.x(), p.y(), 0};
      box.extend(p);
    }
    const auto low = [](double v) { return std::max(0, static_cast<int>(v - 0.5) - kPaintGutter_px); };
    const auto high = [](double v, int size) {
      return std::min(size - 1, static_cast<int>(v - 0.5) + 1 + kPaintGutter_px);
    };
    const int first = std::max(first_row_, low(box.min().y())), last = high(box.max().y(), end_row_);
    for (int y = first; y <= last; ++y)
      for (int x = low(box.min().x()); x <= high(box.max().x(), size().width); ++x)
        offer(Vec3(x + 0.5, y + 0.5, 0), t, corners, owners_[index(x, y)]);
  }

  void offer(const Vec3& pixel, const Triangle& t, const std::array<Vec3, 3>& c, TexelOwner& owner) const {
    const Vec3 nearest = geometry::closest_point_on_triangle(pixel, c[0], c[1], c[2]);
    const double distance_px = (nearest - pixel).norm() < 1e-9 ? 0.0 : (nearest - pixel).norm();
    if (distance_px > owner.distance_px) return;
    const double area = (c[1] - c[0]).cross(c[2] - c[0]).z();
    const double b = area != 0 ? (nearest - c[0]).cross(c[2] - c[0]).z() / area : 0.0;
    const double a = area != 0 ? (c[1] - c[0]).cross(nearest - c[0]).z() / area : 0.0;
    const Vec3 &origin = mesh_.vertices[t[0]], &to_b = mesh_.vertices[t[1]], &to_c = mesh_.vertices[t[2]];
    const Vec3 place = origin + b * (to_b - origin) + a * (to_c - origin);
    const double outwards_m = outwards(chart_.facing, place);
    if (distance_px == owner.distance_px && outwards_m <= owner.outwards_m) return;
    owner = {distance_px, outwards_m, place};
  }

  const TriangleMesh& mesh_;
  const ChartLayout& plan_;
  const FlatChart& chart_;
  std::size_t number_;
  int first_row_ = 0, end_row_ = 0;  ///< rows of the band
  std::vector<TexelOwner> owners_;   ///< one for each pixel
};

void add_chart(const TriangleMesh& mesh, const ChartLayout& plan, const FlatChart& chart, std::size_t number,
               TexturedMesh& out) {
  const Vec2 sheet(plan.packing.size.width, plan.packing.size.height);
  std::unordered_map<std::uint32_t, std::uint32_t> index_of;
  for (const std::uint32_t triangle : chart.triangles) {
    Triangle t = mesh.triangles[triangle];
    for (std::uint32_t& corner : t) {
      const auto [at, is_new] = index_of.try_emplace(corner, static_cast<std::uint32_t>(out.mesh.vertices.size()));
      if (is_new) {
        out.mesh.vertices.push_back(mesh.vertices[corner]);
        const Vec2 uv = plan.pixel(chart, number, mesh.vertices[corner]).cwiseQuotient(sheet);
        out.uv.push_back(uv.cwiseMax(0.0).cwiseMin(1.0).cast<float>());
      }
      corner = at->second;
    }
    out.mesh.triangles.push_back(t);
  }
}

/// Fills unused pixels with the mean colour, to avoid compression artefacts at the charts' edges.
void fill_unused(const imaging::GrayImage& is_painted, imaging::RgbImage& sheet) {
  std::array<std::uint64_t, 3> sum{};
  std::uint64_t count = 0;
  for (std::size_t i = 0; i < sheet.pixels.size(); ++i) {
    if (is_painted.pixels[i] == 0) continue;
    ++count;
    for (std::size_t c = 0; c < 3; ++c) sum[c] += sheet.pixels[i][c];
  }
  imaging::Rgb8 mean{};
  for (std::size_t c = 0; c < 3; ++c) mean[c] = static_cast<std::uint8_t>(sum[c] / std::max<std::uint64_t>(1, count));
  for (std::size_t i = 0; i < sheet.pixels.size(); ++i)
    if (is_painted.pixels[i] == 0) sheet.pixels[i] = mean;
}

}  // namespace

TexturedSurface transfer_colors(const TriangleMesh& surface, const SurfaceColors& colors, const PaintOptions& options) {
  const std::vector<FlatChart> charts = find_charts(surface);
  const ChartLayout plan = plan_atlas(charts, options);
  const auto sheet = std::make_shared<imaging::RgbImage>(plan.packing.size.width, plan.packing.size.height);
  imaging::GrayImage is_painted(plan.packing.size.width, plan.packing.size.height);
  TexturedSurface out;
  out.texel_m = plan.texel_m;
  const bool defers = colors.has_deferred_textures();
  std::vector<UnpaintedTexel> deferred;
  for (std::size_t i = 0; i < charts.size(); ++i) {
    SlotPainter(surface, plan, charts[i], i).paint(colors, *sheet, is_painted, defers ? &deferred : nullptr);
    add_chart(surface, plan, charts[i], i, out.mesh);
  }
  paint_by_texture(colors, deferred, *sheet);
  fill_unused(is_painted, *sheet);
  out.mesh.texture = sheet;
  out.mesh.wrap_u = out.mesh.wrap_v = imaging::Wrap::kClampToEdge;
  return out;
}

}  // namespace tileflight::simplification
