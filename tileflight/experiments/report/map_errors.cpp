#include "tileflight/experiments/report/map_errors.h"

#include <cmath>
#include <nlohmann/json.hpp>

#include "tileflight/core/drawing/number_format.h"

namespace tileflight::report {

const std::vector<float>* find_scalar(const FlightRun& flight, const std::string& name) {
  if (!flight.errors) return nullptr;
  const auto found = flight.errors->scalars.find(name);
  return found == flight.errors->scalars.end() ? nullptr : &found->second;
}

const std::vector<float>* best_distances(const FlightRun& flight) {
  const std::vector<float>* surface = find_scalar(flight, "surface_distance");
  return surface ? surface : find_scalar(flight, "voxel_distance");
}

ScoredRegion::ScoredRegion(const nlohmann::json& results) {
  const auto at = [&](const char* key, int axis) {
    return drawing::number_at(results, "/truth/region/" + std::string(key) + "/" + std::to_string(axis));
  };
  const auto east = at("center", 0), north = at("center", 1), width = at("size", 0), height = at("size", 1);
  if (east && north && width && height)
    extent = drawing::GroundExtent{*east - *width / 2, *east + *width / 2, *north - *height / 2, *north + *height / 2};
}

bool ScoredRegion::contains(const geometry::Vec3& p) const {
  return !extent ||
         (p.x() >= extent->west && p.x() <= extent->east && p.y() >= extent->south && p.y() <= extent->north);
}

std::vector<double> distances_in_region(const ScoredRegion& region, const FlightRun& flight,
                                        const std::vector<float>& distances) {
  std::vector<double> result;
  for (std::size_t i = 0; i < distances.size(); ++i) {
    if (region.contains(flight.errors->positions[i]))
      result.push_back(std::isfinite(distances[i]) ? distances[i] : HUGE_VAL);
  }
  return result;
}

}  // namespace tileflight::report
