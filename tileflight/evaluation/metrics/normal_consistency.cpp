#include "tileflight/evaluation/metrics/normal_consistency.h"

#include <tbb/parallel_for.h>

#include <Eigen/Geometry>
#include <cassert>
#include <cmath>
#include <nlohmann/json.hpp>
#include <vector>

#include "tileflight/core/base/strict_section.h"

namespace tileflight::metrics {

using geometry::Vec3;

namespace {

constexpr double kNoNormal = std::numeric_limits<double>::quiet_NaN();
const double kCos30 = std::sqrt(3.0) / 2.0;

double abs_cos(const Vec3& a, const Vec3& b) {
  const double lengths = a.norm() * b.norm();
  return lengths > 0.0 ? std::min(1.0, std::abs(a.dot(b)) / lengths) : kNoNormal;
}

}  // namespace

Vec3 triangle_direction(const geometry::TriangleMesh& mesh, std::size_t triangle) {
  const auto& [a, b, c] = mesh.triangles[triangle];
  return (mesh.vertices[b] - mesh.vertices[a]).cross(mesh.vertices[c] - mesh.vertices[a]);
}

NormalConsistency normal_consistency(const geometry::PointCloud& map, const geometry::TriangleMesh& surface,
                                     const geometry::TriangleIndex& index, double within_m, std::size_t neighbors) {
  std::vector<Vec3> nearest(map.size(), Vec3::Zero());
  tbb::parallel_for(std::size_t{0}, map.size(), [&](std::size_t i) {
    if (const auto found = index.nearest(map.positions[i], within_m))
      nearest[i] = triangle_direction(surface, found->triangle);
  });
  return normal_consistency(map, nearest, within_m, neighbors);
}

NormalConsistency normal_consistency(const geometry::PointCloud& map, const std::vector<Vec3>& nearest, double within_m,
                                     std::size_t neighbors) {
  assert(map.normals.size() == map.size() && nearest.size() == map.size());
  std::vector<double> cosines(map.size(), kNoNormal);
  tbb::parallel_for(std::size_t{0}, map.size(),
                    [&](std::size_t i) { cosines[i] = abs_cos(map.normals[i].cast<double>(), nearest[i]); });
  NormalConsistency result{.points = map.size(), .sampled = map.size(), .within_m = within_m, .neighbors = neighbors};
  double sum = 0.0, close = 0.0;
  for (const double cosine : cosines) {
    if (std::isnan(cosine)) continue;
    sum += cosine;
    close += cosine >= kCos30 ? 1.0 : 0.0;
    ++result.evaluated;
  }
  if (result.evaluated == 0) return result;
  result.mean_abs_cos = sum / static_cast<double>(result.evaluated);
  result.share_within_30_deg = close / static_cast<double>(result.evaluated);
  return result;
}

nlohmann::json to_json(const NormalConsistency& n) {
  const double share = n.sampled > 0 ? static_cast<double>(n.evaluated) / static_cast<double>(n.sampled) : 0.0;
  return {{"points", n.points},
          {"asked", n.sampled},
          {"judged", n.evaluated},
          {"share_judged", share},
          {"within", n.within_m},
          {"neighbors", n.neighbors},
          {"mean_abs_cos", n.mean_abs_cos},
          {"share_within_30_deg", n.share_within_30_deg}};
}

NormalConsistency read_normal_consistency(base::StrictSection reader) {
  NormalConsistency n;
  n.points = reader.required_count("points");
  n.sampled = reader.has("asked") ? reader.required_count("asked") : n.points;  // older files used all points
  n.evaluated = reader.required_count("judged");
  reader.required_number("share_judged");  // follows from the counts
  n.within_m = reader.required_number("within");
  n.neighbors = reader.required_count("neighbors");
  n.mean_abs_cos = reader.required_number("mean_abs_cos");
  n.share_within_30_deg = reader.required_number("share_within_30_deg");
  reader.require_all_keys_used();
  return n;
}

}  // namespace tileflight::metrics
