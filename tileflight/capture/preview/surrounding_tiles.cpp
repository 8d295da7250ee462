#include "tileflight/capture/preview/surrounding_tiles.h"

#include <algorithm>
#include <array>

namespace tileflight::preview {
namespace {

using geometry::Box3;
using geometry::Vec3;

/// Positions along the path, subsampled where that makes no difference.
std::vector<Vec3> subsample_path(const geometry::Trajectory& frames) {
  const double step_m = std::max(0.25, geometry::path_length_m(frames) / 2000);
  std::vector<Vec3> path;
  for (const geometry::StampedPose& pose : frames.poses) {
    const Vec3& p = pose.T_local_camera.translation;
    if (path.empty() || (p - path.back()).norm() >= step_m) path.push_back(p);
  }
  return path;
}

/// Tiles for the checks: resolution as a share of their distance, within a range of the path.
struct DetailLevel {
  double error_share, reach_m;
};

}  // namespace

SurroundingTiles read_surroundings(PreviewedFlight& flight, const Progress& progress) {
  constexpr std::array<DetailLevel, 5> kDetails{{{0.005, 20e3}, {0.01, 5e3}, {0.02, 2e3}, {0.05, 1e3}, {0.1, 300}}};
  const geometry::SE3& T_local_tileset = flight.place.placement().T_local_tileset;
  Box3 path_box;
  std::vector<tileset::ViewCone> cones;
  for (const Vec3& p : subsample_path(flight.frames())) {
    path_box.extend(p);
    cones.push_back({.position = p});
  }
  for (const DetailLevel& detail : kDetails) {
    for (tileset::ViewCone& cone : cones) cone.pixels_per_rad = 1 / detail.error_share;
    const Vec3 around(detail.reach_m, detail.reach_m, 20e3);
    const tileset::RefinementCriterion wanted =
        place::restrict_to_box(tileset::limit_refinement(tileset::flight_criterion(cones, T_local_tileset, 1.0),
                                                       flight.settings.render.load.error_m),
                               Box3(path_box.min() - around, path_box.max() + around), T_local_tileset);
    if (auto part = flight.place.read(flight.place.select_cut(wanted), false, flight.memory / 2, progress))
      return {std::move(*part), &detail != kDetails.data()};
  }
  throw tileset::MemoryLimitExceeded(flight.place.name(),
                                   "the tiles around the path need more memory than the limit; raise it (--memory)");
}

}  // namespace tileflight::preview
