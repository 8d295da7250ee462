#include "tileflight/world/ground_truth/suggested_voxel.h"

#include <algorithm>
#include <cmath>
#include <sstream>

namespace tileflight::ground_truth {
namespace {

constexpr double kPublishedEdge_m = 1.0, kPublishedCells = 250.0;
constexpr double kFewCells = 50.0;
constexpr double kMinEdge_m = 0.001;

std::string rounded(double metres) {
  std::ostringstream text;
  text.precision(metres < 1 ? 1 : metres < 10 ? 2 : metres < 100 ? 3 : 4);
  text << metres;
  return text.str();
}

}  // namespace

double suggest_voxel_m(const geometry::Vec3& extent_m) {
  const double target_m = std::clamp(extent_m.maxCoeff() / kPublishedCells, kMinEdge_m, kPublishedEdge_m);
  const double power = std::pow(10.0, std::floor(std::log10(target_m)));
  double nearest_m = power;
  for (const double factor : {1.0, 2.0, 5.0, 10.0}) {
    const auto off = [&](double edge_m) { return std::abs(std::log(edge_m / target_m)); };
    if (off(factor * power) < off(nearest_m)) nearest_m = factor * power;
  }
  return std::min(nearest_m, kPublishedEdge_m);
}

std::optional<std::string> coarse_voxel_warning(const geometry::Vec3& extent_m, double voxel_m) {
  if (!(extent_m.maxCoeff() > 0) || extent_m.maxCoeff() >= kFewCells * voxel_m) return std::nullopt;
  return "voxels of " + rounded(voxel_m) + " m are coarse for a surface of " + rounded(extent_m.x()) + " x " +
         rounded(extent_m.y()) + " x " + rounded(extent_m.z()) + " m: errors below half a voxel hardly show in the " +
         "distance to their centres; use --voxel " + rounded(suggest_voxel_m(extent_m));
}

}  // namespace tileflight::ground_truth
