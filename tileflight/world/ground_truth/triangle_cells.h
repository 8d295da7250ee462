#pragma once

// Which unit cells a triangle touches.
//
// Notation: coordinates are in cells, cell k covers [k, k + 1] along each axis. The separating axis test of a box and a
// triangle (Akenine-Moeller 2001) has 13 axes: 3 of the box, the triangle's normal, 9 cross products of an axis and a
// side. For a column of cells along axis w each of them is an inequality that is linear in the cell's index k_w, so
// together they leave an interval of cells (the idea of Schwarz and Seidel, Fast Parallel Surface and Solid
// Voxelization on GPUs, 2010, section 4): no cell is tested on its own. Axes u, v span the columns; w is the axis along
// which the triangle's normal is longest.
//
// Invariant: rounding never loses a touched cell. All tests are widened by `tolerance`, which is negligible (1e-9 of a
// cell) but far above rounding errors, so faces exactly between two cells touch both.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <type_traits>
#include <utility>

#include "tileflight/core/base/noise.h"
#include "tileflight/core/geometry/mesh.h"
#include "tileflight/world/ground_truth/voxelize.h"

namespace tileflight::ground_truth {

/// A triangle's corners, in cells.
using CellTriangle = std::array<geometry::Vec3, 3>;

constexpr double kTouchTolerance_cells = 1e-9;

inline std::int32_t ceil_int(double value) { return -base::floor_to_int(-value); }

/// Cells that the triangle's bounding box touches, extended by at most one cell beyond `dims` on either side (two cells
/// outside stand for all further ones).
inline CellRange bounding_cells(const CellTriangle& t, const std::array<std::int32_t, 3>& dims) {
  CellRange range;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto a = static_cast<int>(axis);
    const double low = std::min({t[0][a], t[1][a], t[2][a]}) - kTouchTolerance_cells;
    const double high = std::max({t[0][a], t[1][a], t[2][a]}) + kTouchTolerance_cells;
    range.low[axis] = ceil_int(std::clamp(low, -1.0, dims[axis] + 2.0)) - 1;
    range.high[axis] = base::floor_to_int(std::clamp(high, -2.0, dims[axis] + 1.0));
  }
  return range;
}

/// An interval of cell indices as real numbers: k is in it if low <= k <= high.
struct Interval {
  double low, high;

  void intersect(const Interval& other) {
    low = std::max(low, other.low);
    high = std::min(high, other.high);
  }
};

/// Separating axis test for the projection of the triangle on the plane (c, w), with the cross products of its sides
/// and the plane's normal as axes: for a column k_c, the interval of k_w that they allow.
class ProjectedSides {
 public:
  ProjectedSides(const CellTriangle& t, std::size_t c, std::size_t w, double tolerance) {
    for (std::size_t i = 0; i < 3; ++i) set_side(i, t, static_cast<int>(c), static_cast<int>(w), tolerance);
  }

  /// Intersects `range` with the interval of k_w that column k_c allows.
  void narrow(double k_c, Interval& range) const {
    for (const Bound& b : bounds_) {
      range.low = std::max(range.low, b.low - b.slope * k_c);
      range.high = std::min(range.high, b.high - b.slope * k_c);
    }
  }

 private:
  struct Bound {
    double low, high, slope;
  };

  /// Side i is the line a c + b w = const in the plane; the triangle spans an interval of that constant and the square
  /// [k_c, k_c + 1] x [k_w, k_w + 1] spans a k_c + b k_w + [min(a, 0) + min(b, 0), max(a, 0) + max(b, 0)]. The two
  /// intervals must intersect.
  void set_side(std::size_t i, const CellTriangle& t, int c, int w, double tolerance) {
    const geometry::Vec3& p = t[i];
    const geometry::Vec3& q = t[(i + 1) % 3];
    const geometry::Vec3& opposite = t[(i + 2) % 3];
    double a = p[w] - q[w];
    double b = q[c] - p[c];
    // A side along w adds nothing to the bounding box.
    if (std::abs(b) <= 1e-14 * std::abs(a)) return;
    if (b < 0.0) {
      a = -a;
      b = -b;
    }
    const double on_side = a * p[c] + b * p[w];
    const double on_opposite = a * opposite[c] + b * opposite[w];
    const double slack = tolerance * (std::abs(a) + b);
    const double inverse = 1.0 / b;
    bounds_[i].low = (std::min(on_side, on_opposite) - slack - std::max(a, 0.0) - b) * inverse;
    bounds_[i].high = (std::max(on_side, on_opposite) + slack - std::min(a, 0.0)) * inverse;
    bounds_[i].slope = a * inverse;
  }

  std::array<Bound, 3> bounds_{{{-1e18, 1e18, 0.0}, {-1e18, 1e18, 0.0}, {-1e18, 1e18, 0.0}}};
};

/// The triangle's plane: the interval of cells k_w in the column (k_u, k_v) that it passes through.
class ColumnPlane {
 public:
  /// `normal` is not zero along w. A sliver's normal is dominated by rounding, so the interval is computed from the
  /// projections of all three corners on it.
  ColumnPlane(const geometry::Vec3& normal, const CellTriangle& t, int u, int v, int w, double tolerance) {
    const geometry::Vec3 n = normal[w] < 0.0 ? geometry::Vec3(-normal) : normal;
    const double inverse = 1.0 / n[w];
    const geometry::Vec3 d(n.dot(t[0]), n.dot(t[1]), n.dot(t[2]));
    const double slack = tolerance * n.lpNorm<1>();
    low_ = (d.minCoeff() - slack - n.cwiseMax(0.0).sum()) * inverse;
    high_ = (d.maxCoeff() + slack - n.cwiseMin(0.0).sum()) * inverse;
    slope_u_ = n[u] * inverse;
    slope_v_ = n[v] * inverse;
  }

  Interval interval(double k_u, double k_v) const {
    const double shift = slope_u_ * k_u + slope_v_ * k_v;
    return {low_ - shift, high_ - shift};
  }

 private:
  double low_, high_, slope_u_, slope_v_;
};

/// Calls run(cell, axis, last) for runs of touched cells: from `cell` along `axis` up to index `last`.
template <typename Run>
class TouchedCells {
 public:
  /// `inside`: the triangle's bounding cells in the grid; `wanted`: those of them to report, not empty. What is
  /// reported of a cell does not depend on which others are wanted: coordinates are relative to `inside` always.
  TouchedCells(const CellTriangle& t, const CellRange& inside, const CellRange& wanted, Run& run)
      : inside_(inside), run_(run) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      first_[axis] = wanted.low[axis] - inside.low[axis];
      last_[axis] = wanted.high[axis] - inside.low[axis];
    }
    // Coordinates relative to the first cell keep more digits.
    const geometry::Vec3 base(inside.low[0], inside.low[1], inside.low[2]);
    for (std::size_t i = 0; i < 3; ++i) t_[i] = t[i] - base;
    double farthest = 0.0;
    for (const geometry::Vec3& p : t_) farthest = std::max(farthest, p.lpNorm<Eigen::Infinity>());
    tolerance_ = kTouchTolerance_cells + 1e-14 * farthest;
  }

  /// The triangle fits into one cell along all axes but `w`: it touches every cell of the resulting row.
  void row(std::size_t w) {
    auto cell = inside_.low;
    cell[w] += first_[w];
    run_(cell, w, inside_.low[w] + last_[w]);
  }

  /// The triangle fits into one cell along the third axis: only its projection on (u, w) matters.
  void layer(std::size_t u, std::size_t w) {
    const ProjectedSides sides(t_, u, w, tolerance_);
    const Interval all = whole(w);
    for (std::int32_t k_u = first_[u]; k_u <= last_[u]; ++k_u) {
      Interval range = all;
      sides.narrow(k_u, range);
      auto cell = inside_.low;
      cell[u] += k_u;
      emit(cell, w, range);
    }
  }

  void volume() {
    const geometry::Vec3 normal = (t_[1] - t_[0]).cross(t_[2] - t_[0]);
    int longest = 0;
    normal.cwiseAbs().maxCoeff(&longest);
    const auto w = static_cast<std::size_t>(longest);
    const std::size_t u = (w + 1) % 3;
    const std::size_t v = (w + 2) % 3;
    // A triangle without area has no plane; the tests of its sides suffice.
    if (normal[longest] == 0.0) return columns(u, v, w, [](double, double) { return Interval{-1e18, 1e18}; });
    const ColumnPlane plane(normal, t_, static_cast<int>(u), static_cast<int>(v), longest, tolerance_);
    columns(u, v, w, [&](double k_u, double k_v) { return plane.interval(k_u, k_v); });
  }

 private:
  Interval whole(std::size_t axis) const {
    return {static_cast<double>(first_[axis]), static_cast<double>(last_[axis])};
  }

  template <typename Plane>
  void columns(std::size_t u, std::size_t v, std::size_t w, Plane plane) {
    const ProjectedSides sides_uv(t_, u, v, tolerance_);
    const ProjectedSides sides_uw(t_, u, w, tolerance_);
    const ProjectedSides sides_vw(t_, v, w, tolerance_);
    for (std::int32_t k_u = first_[u]; k_u <= last_[u]; ++k_u) {
      Interval range_v = whole(v);
      Interval range_w = whole(w);
      sides_uv.narrow(k_u, range_v);
      sides_uw.narrow(k_u, range_w);
      if (!(range_v.low <= range_v.high) || !(range_w.low <= range_w.high)) continue;
      auto cell = inside_.low;
      cell[u] += k_u;
      for (std::int32_t k_v = ceil_int(range_v.low); k_v <= base::floor_to_int(range_v.high); ++k_v) {
        Interval range = range_w;
        sides_vw.narrow(k_v, range);
        range.intersect(plane(k_u, k_v));
        cell[v] = inside_.low[v] + k_v;
        emit(cell, w, range);
      }
    }
  }

  void emit(std::array<std::int32_t, 3> cell, std::size_t w, const Interval& range) {
    if (!(range.low <= range.high)) return;
    const std::int32_t first = ceil_int(range.low);
    const std::int32_t last = base::floor_to_int(range.high);
    if (first > last) return;
    const std::int32_t base = cell[w];
    cell[w] = base + first;
    run_(cell, w, base + last);
  }

  CellTriangle t_;
  CellRange inside_;
  std::array<std::int32_t, 3> first_{}, last_{};  ///< of the wanted cells, relative to `inside_`
  Run& run_;
  double tolerance_ = kTouchTolerance_cells;
};

/// Calls run(cell, axis, last) for the runs of cells in a part (`window`) of a grid of `dims` cells that the triangle
/// touches; a cell may be reported more than once. The cells of several windows are those of their union.
template <typename Run>
void visit_touched_cells(const CellTriangle& t, const std::array<std::int32_t, 3>& dims, const CellRange& window,
                         Run&& run) {
  const CellRange range = bounding_cells(t, dims);
  const CellRange inside = clip_to_grid(range, dims);
  const CellRange wanted = intersection(inside, window);
  if (wanted.empty()) return;
  std::array<std::size_t, 3> wide{};
  std::size_t wide_axes = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (range.count(axis) > 1) wide[wide_axes++] = axis;
  }
  TouchedCells<std::remove_reference_t<Run>> cells(t, inside, wanted, run);
  switch (wide_axes) {
    case 0:
    case 1:
      return cells.row(wide_axes == 0 ? 2 : wide[0]);
    case 2:
      return cells.layer(wide[0], wide[1]);
    default:
      return cells.volume();
  }
}

/// Visits the cells in the whole grid.
template <typename Run>
void visit_touched_cells(const CellTriangle& t, const std::array<std::int32_t, 3>& dims, Run&& run) {
  visit_touched_cells(t, dims, whole_grid(dims), std::forward<Run>(run));
}

}  // namespace tileflight::ground_truth
