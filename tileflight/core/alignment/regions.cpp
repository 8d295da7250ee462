#include "tileflight/core/alignment/regions.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <nlohmann/json.hpp>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/geometry/json_numbers.h"
#include "tileflight/core/geometry/point_order.h"

namespace tileflight::alignment {
using geometry::Box3;
using geometry::Mat3;
using geometry::PointCloud;
using geometry::Vec3;
using nlohmann::json;

namespace {

/// Area-weighted sum of n n^T.
struct NormalScatter {
  Mat3 sum = Mat3::Zero();
  double area = 0.0;

  void add(const Vec3& normal, double weight) {
    sum += weight * normal * normal.transpose();
    area += weight;
  }
  /// Eigenvalues of the mean, increasing; they sum to one.
  Vec3 eigenvalues() const {
    return Eigen::SelfAdjointEigenSolver<Mat3>(sum / area, Eigen::EigenvaluesOnly).eigenvalues();
  }
};

using PatchKey = std::array<std::int64_t, 3>;
using CellKey = std::array<std::int64_t, 2>;

struct Cell {
  NormalScatter normals;
  std::map<PatchKey, NormalScatter> patches;
  Box3 box;                         ///< of its triangles' centroids
  std::vector<std::size_t> points;  ///< number of points of each map
};

std::int64_t cell_index(double x, double size) { return static_cast<std::int64_t>(std::floor(x / size)); }

CellKey cell_key(const Vec3& p, const FindRegionsOptions& o) {
  return {cell_index(p.x(), o.cell_m), cell_index(p.y(), o.cell_m)};
}

std::map<CellKey, Cell> bin_surface(const geometry::TriangleMesh& surface, const FindRegionsOptions& options) {
  std::map<CellKey, Cell> cells;
  for (const auto& [a, b, c] : surface.triangles) {
    const Vec3& o = surface.vertices[a];
    const Vec3 cross = (surface.vertices[b] - o).cross(surface.vertices[c] - o);
    const double length = cross.norm();
    if (!(length > 0.0)) continue;
    const Vec3 middle = (o + surface.vertices[b] + surface.vertices[c]) / 3.0;
    Cell& cell = cells[cell_key(middle, options)];
    const double size = options.patch_m;
    cell.normals.add(cross / length, 0.5 * length);
    cell.patches[{cell_index(middle.x(), size), cell_index(middle.y(), size), cell_index(middle.z(), size)}].add(
        cross / length, 0.5 * length);
    cell.box.extend(middle);
  }
  return cells;
}

/// Mean over the patches of the share of normals in one direction, mapped from [1/3, 1] (isotropic to flat) to [0, 1].
double mean_planarity(const Cell& cell) {
  double sum = 0.0;
  for (const auto& [key, patch] : cell.patches) sum += patch.area * (patch.eigenvalues()[2] - 1.0 / 3.0) * 1.5;
  return sum / cell.normals.area;
}

void count_points(const std::vector<const PointCloud*>& maps, const FindRegionsOptions& options,
                  std::map<CellKey, Cell>& cells) {
  for (auto& [key, cell] : cells) cell.points.assign(maps.size(), 0);
  for (std::size_t m = 0; m < maps.size(); ++m) {
    for (const Vec3& p : maps[m]->positions) {
      const auto cell = p.allFinite() ? cells.find(cell_key(p, options)) : cells.end();
      if (cell == cells.end()) continue;
      const Box3& box = cell->second.box;
      if (p.z() >= box.min().z() - options.margin_m && p.z() <= box.max().z() + options.margin_m)
        ++cell->second.points[m];
    }
  }
}

Box3 column_box(const CellKey& key, const Cell& cell, const FindRegionsOptions& options) {
  const Vec3 low(static_cast<double>(key[0]) * options.cell_m, static_cast<double>(key[1]) * options.cell_m,
                 cell.box.min().z() - options.margin_m);
  return {low, Vec3(low.x() + options.cell_m, low.y() + options.cell_m, cell.box.max().z() + options.margin_m)};
}

std::vector<FoundRegion> best_regions(const std::map<CellKey, Cell>& cells, const FindRegionsOptions& options) {
  constexpr double kFewCorners = 0.02;  // as for a floor with a few curbs; chosen by hand
  std::vector<FoundRegion> found;
  for (const auto& [key, cell] : cells) {
    const bool seen = std::ranges::all_of(cell.points, [&](std::size_t n) { return n >= options.min_points; });
    const double corners = cell.normals.eigenvalues()[0];
    if (seen && corners >= kFewCorners)
      found.push_back({column_box(key, cell, options), corners, mean_planarity(cell)});
  }
  std::ranges::stable_sort(found, std::greater<>(),
                           [](const FoundRegion& r) { return r.corner_strength * r.planarity * r.planarity; });
  if (found.size() > options.max_regions) found.resize(options.max_regions);
  return found;
}

json boxes_json(const std::vector<Box3>& boxes) {
  json list = json::array();
  for (const Box3& box : boxes)
    list.push_back({{"center", geometry::json_numbers(box.center())}, {"size", geometry::json_numbers(box.sizes())}});
  return list;
}

Vec3 vector_of(const json& box, const char* key, const std::string& where) {
  const json& v = box.is_object() && box.contains(key) ? box[key] : json();
  const auto is_number = [](const json& x) { return x.is_number() && std::isfinite(x.get<double>()); };
  if (!v.is_array() || v.size() != 3 || !std::all_of(v.begin(), v.end(), is_number))
    throw InputError(where, std::string("a region needs '") + key + "', three numbers");
  return {v[0].get<double>(), v[1].get<double>(), v[2].get<double>()};
}

std::vector<Box3> boxes_of(const json& regions, const char* key, const std::string& where) {
  if (!regions.contains(key)) return {};
  if (!regions[key].is_array()) throw InputError(where, std::string("'") + key + "' must be a list of regions");
  std::vector<Box3> boxes;
  for (const json& box : regions[key]) {
    const Vec3 center = vector_of(box, "center", where), half = 0.5 * vector_of(box, "size", where);
    if (!(half.minCoeff() > 0.0)) throw InputError(where, "the size of a region must be positive");
    boxes.emplace_back(center - half, center + half);
  }
  return boxes;
}

}  // namespace

FoundRegions find_regions(const geometry::TriangleMesh& surface, const std::vector<const PointCloud*>& maps,
                          const FindRegionsOptions& options) {
  std::map<CellKey, Cell> cells = bin_surface(surface, options);
  count_points(maps, options, cells);
  const std::vector<FoundRegion> best = best_regions(cells, options);
  FoundRegions regions;
  constexpr std::size_t kFewest = 4;
  if (best.size() < kFewest) return regions;
  std::vector<Vec3> centers;
  for (const FoundRegion& r : best) centers.push_back(r.box.center());
  bool keep_back = false;
  for (const std::uint32_t k : geometry::morton_order(centers, geometry::kCoarseMortonCells)) {
    (keep_back ? regions.held_out : regions.aligned_on).push_back(best[k]);
    keep_back = !keep_back;
  }
  return regions;
}

json to_json(const RegionList& regions) {
  return {{"found", regions.found},
          {"aligned_on", boxes_json(regions.aligned_on)},
          {"held_out", boxes_json(regions.held_out)}};
}

RegionList regions_from_json(const json& regions, const std::string& where) {
  if (!regions.is_object()) throw InputError(where, "'regions' must be an object");
  return {boxes_of(regions, "aligned_on", where), boxes_of(regions, "held_out", where),
          regions.contains("found") && regions["found"].is_boolean() && regions["found"].get<bool>()};
}

}  // namespace tileflight::alignment
