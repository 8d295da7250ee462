#include "tileflight/tiles/tile_content/alpha_cutout.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <vector>

namespace tileflight::tile_content::gltf {
namespace {

/// Maximum number of pieces beyond one for each triangle: this many for each, but at least and at most these for all.
constexpr std::size_t kMostPiecesEach = 32;
constexpr std::size_t kFewestPieces = 200'000;
constexpr std::size_t kMostPieces = 1'000'000;
constexpr int kCoarsestCell = 1 << 20;
/// Texture coordinates beyond this number of texels are not cut.
constexpr double kMostTexels = 1e9;

/// Number of opaque texels in any rectangle of an image.
class OpaqueCounts {
 public:
  explicit OpaqueCounts(const OpacityMask& mask)
      : width_(mask.alpha.width),
        height_(mask.alpha.height),
        sums_(std::size_t(width_ + 1) * std::size_t(height_ + 1)) {
    for (int y = 0; y < height_; ++y) {
      std::int64_t row = 0;
      for (int x = 0; x < width_; ++x) {
        row += mask.alpha(x, y) >= mask.least_opaque ? 1 : 0;
        sums_[index(x + 1, y + 1)] = sums_[index(x + 1, y)] + row;
      }
    }
  }

  std::int64_t within(std::int64_t x0, std::int64_t y0, std::int64_t x1, std::int64_t y1) const {
    return sums_[index(x1, y1)] - sums_[index(x0, y1)] - sums_[index(x1, y0)] + sums_[index(x0, y0)];
  }
  std::int64_t all() const { return sums_.back(); }
  std::int64_t texels() const { return std::int64_t{width_} * height_; }

 private:
  std::size_t index(std::int64_t x, std::int64_t y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width_ + 1) + static_cast<std::size_t>(x);
  }

  int width_, height_;
  std::vector<std::int64_t> sums_;
};

/// An interval of texels, and the interval of the image that it shows.
struct Span {
  std::int64_t begin = 0, end = 0;
};

/// Where an interval must be divided so that each part lies in one repetition of the image; nullopt: it does.
std::optional<std::int64_t> seam_within(const Span& span, std::int64_t size, imaging::Wrap wrap) {
  if (wrap == imaging::Wrap::kClampToEdge) {
    if (span.begin < 0 && span.end > 0) return 0;
    if (span.begin < size && span.end > size) return size;
    return std::nullopt;
  }
  const auto floor_div = [](std::int64_t a, std::int64_t b) { return a / b - (a % b < 0 ? 1 : 0); };
  const std::int64_t first = floor_div(span.begin, size), last = floor_div(span.end - 1, size);
  if (first == last) return std::nullopt;
  return size * (first + (last - first + 1) / 2);
}

Span shown(const Span& span, std::int64_t size, imaging::Wrap wrap) {
  const std::int64_t a = imaging::wrapped_index(span.begin, size, wrap);
  const std::int64_t b = imaging::wrapped_index(span.end - 1, size, wrap);
  return {std::min(a, b), std::max(a, b) + 1};
}

/// A corner of a piece: its weights in the triangle, and its place in the texture in texels.
struct Corner {
  std::array<double, 2> at{};
  std::array<double, 3> weights{};
};
using Polygon = std::vector<Corner>;

Corner between(const Corner& a, const Corner& b, double share) {
  Corner out;
  for (std::size_t i = 0; i < 2; ++i) out.at[i] = a.at[i] + share * (b.at[i] - a.at[i]);
  for (std::size_t i = 0; i < 3; ++i) out.weights[i] = a.weights[i] + share * (b.weights[i] - a.weights[i]);
  return out;
}

/// The part of a convex polygon at one side of a line across an axis.
Polygon clipped(const Polygon& polygon, std::size_t axis, double limit, bool below) {
  Polygon out;
  const auto inside = [&](const Corner& c) { return below ? c.at[axis] <= limit : c.at[axis] >= limit; };
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Corner &a = polygon[i], &b = polygon[(i + 1) % polygon.size()];
    if (inside(a)) out.push_back(a);
    if (inside(a) == inside(b) || a.at[axis] == limit || b.at[axis] == limit) continue;
    out.push_back(between(a, b, (limit - a.at[axis]) / (b.at[axis] - a.at[axis])));
    out.back().at[axis] = limit;
  }
  return out;
}

bool has_area(const Polygon& polygon) {
  double twice_area = 0.0;
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Corner &a = polygon[i], &b = polygon[(i + 1) % polygon.size()];
    twice_area += a.weights[1] * b.weights[2] - b.weights[1] * a.weights[2];
  }
  return std::abs(twice_area) > 1e-14;
}

/// Cuts the triangles of a surface, with cells of one size.
class Cutter {
 public:
  Cutter(const OpacityMask& mask, const OpaqueCounts& counts, std::span<const Eigen::Vector2f> uv, const Geometry& from,
         int cell)
      : mask_(mask), counts_(counts), uv_(uv), from_(from), cell_(cell), out_(from) {
    out_.triangles.clear();
  }

  /// False: there are too many pieces.
  bool cut() {
    const std::size_t triangles = from_.triangles.size();
    const std::size_t most = triangles + std::clamp(kMostPiecesEach * triangles, kFewestPieces, kMostPieces);
    for (const geometry::Triangle& triangle : from_.triangles) {
      if (!cut(triangle, most)) return false;
    }
    return true;
  }

  Geometry& result() { return out_; }
  bool changed() const { return changed_; }

 private:
  struct Piece {
    Polygon polygon;
    Span x, y;
  };

  bool cut(const geometry::Triangle& triangle, std::size_t most) {
    Polygon whole(3);
    for (std::size_t k = 0; k < 3; ++k) {
      whole[k].at = {double{uv_[triangle[k]].x()} * mask_.alpha.width,
                     double{uv_[triangle[k]].y()} * mask_.alpha.height};
      whole[k].weights[k] = 1.0;
    }
    const Span x = texels_of(whole, 0), y = texels_of(whole, 1);
    pieces_.clear();
    bool all_kept = true;
    std::vector<Piece> pending = {{whole, x, y}};
    while (!pending.empty()) {
      const Piece piece = std::move(pending.back());
      pending.pop_back();
      if (++steps_ > 4 * most || out_.triangles.size() + pieces_.size() > most) return false;
      const std::optional<bool> opaque = is_opaque(piece);
      if (opaque) {
        all_kept = all_kept && *opaque;
        if (*opaque) pieces_.push_back(piece.polygon);
        continue;
      }
      divide(piece, pending);
    }
    if (all_kept) {
      out_.triangles.push_back(triangle);
      return true;
    }
    changed_ = true;
    for (const Polygon& polygon : pieces_) emit(polygon, triangle);
    return true;
  }

  static Span texels_of(const Polygon& polygon, std::size_t axis) {
    double low = polygon[0].at[axis], high = low;
    for (const Corner& corner : polygon) {
      low = std::min(low, corner.at[axis]);
      high = std::max(high, corner.at[axis]);
    }
    constexpr double kFarthest = 1e15;
    const auto begin = static_cast<std::int64_t>(std::floor(std::clamp(low, -kFarthest, kFarthest)));
    const auto end = static_cast<std::int64_t>(std::ceil(std::clamp(high, -kFarthest, kFarthest)));
    return {begin, std::max(end, begin + 1)};
  }

  /// nullopt: the piece must be divided.
  std::optional<bool> is_opaque(const Piece& piece) const {
    const bool is_small = piece.x.end - piece.x.begin <= cell_ && piece.y.end - piece.y.begin <= cell_;
    if (seam_within(piece.x, mask_.alpha.width, mask_.wrap_u) ||
        seam_within(piece.y, mask_.alpha.height, mask_.wrap_v)) {
      return is_small && cell_ > 1 ? std::optional(2 * counts_.all() >= counts_.texels()) : std::nullopt;
    }
    const Span x = shown(piece.x, mask_.alpha.width, mask_.wrap_u);
    const Span y = shown(piece.y, mask_.alpha.height, mask_.wrap_v);
    const std::int64_t texels = (x.end - x.begin) * (y.end - y.begin);
    const std::int64_t opaque = counts_.within(x.begin, y.begin, x.end, y.end);
    if (opaque == 0) return false;
    if (opaque == texels) return true;
    if (!is_small) return std::nullopt;
    return 2 * opaque >= texels;
  }

  void divide(const Piece& piece, std::vector<Piece>& pending) const {
    const auto seam_x = seam_within(piece.x, mask_.alpha.width, mask_.wrap_u);
    const auto seam_y = seam_within(piece.y, mask_.alpha.height, mask_.wrap_v);
    std::size_t axis = 0;
    std::int64_t at = 0;
    if (seam_x || seam_y) {
      axis = seam_x ? 0 : 1;
      at = seam_x ? *seam_x : *seam_y;
    } else {
      const std::int64_t wide = piece.x.end - piece.x.begin, high = piece.y.end - piece.y.begin;
      axis = wide >= high ? 0 : 1;
      const Span& longer = axis == 0 ? piece.x : piece.y;
      at = longer.begin + (longer.end - longer.begin) / 2;
    }
    for (const bool below : {false, true}) {
      Polygon part = clipped(piece.polygon, axis, static_cast<double>(at), below);
      if (part.size() < 3 || !has_area(part)) continue;
      Span x = texels_of(part, 0), y = texels_of(part, 1);
      pending.push_back({std::move(part), x, y});
    }
  }

  void emit(const Polygon& polygon, const geometry::Triangle& triangle) {
    const auto first = static_cast<std::uint32_t>(out_.vertex_count());
    for (const Corner& corner : polygon) {
      interpolate(from_.positions, 3, corner, triangle, out_.positions);
      interpolate(from_.tex_coords, 2, corner, triangle, out_.tex_coords);
      interpolate(from_.colors, from_.color_components, corner, triangle, out_.colors);
      interpolate(from_.feature_coords, 2, corner, triangle, out_.feature_coords);
      if (from_.feature_ids.empty()) continue;
      const auto nearest = std::max_element(corner.weights.begin(), corner.weights.end()) - corner.weights.begin();
      out_.feature_ids.push_back(from_.feature_ids[triangle[static_cast<std::size_t>(nearest)]]);
    }
    for (std::uint32_t k = 2; k < polygon.size(); ++k) out_.triangles.push_back({first, first + k - 1, first + k});
  }

  static void interpolate(const std::vector<float>& from, std::size_t components, const Corner& corner,
                          const geometry::Triangle& triangle, std::vector<float>& out) {
    if (from.empty()) return;
    for (std::size_t c = 0; c < components; ++c) {
      double value = 0.0;
      for (std::size_t k = 0; k < 3; ++k) value += corner.weights[k] * double{from[components * triangle[k] + c]};
      out.push_back(static_cast<float>(value));
    }
  }

  const OpacityMask& mask_;
  const OpaqueCounts& counts_;
  std::span<const Eigen::Vector2f> uv_;
  const Geometry& from_;
  std::int64_t cell_;
  Geometry out_;
  std::vector<Polygon> pieces_;
  std::size_t steps_ = 0;
  bool changed_ = false;
};

}  // namespace

int cut_out(const OpacityMask& mask, std::span<const Eigen::Vector2f> uv, Geometry& geometry) {
  if (mask.alpha.empty()) return 0;
  const OpaqueCounts counts(mask);
  if (counts.all() == counts.texels()) return 0;
  const double most_uv = kMostTexels / std::max(mask.alpha.width, mask.alpha.height);
  if (std::ranges::any_of(uv, [&](const Eigen::Vector2f& at) { return double{at.cwiseAbs().maxCoeff()} > most_uv; }))
    return -1;
  for (int cell = 1; cell <= kCoarsestCell; cell *= 4) {
    Cutter cutter(mask, counts, uv, geometry, cell);
    if (!cutter.cut()) continue;
    if (!cutter.changed()) return 0;
    geometry = std::move(cutter.result());
    return cell;
  }
  return -1;
}

}  // namespace tileflight::tile_content::gltf
