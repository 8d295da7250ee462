#include "tileflight/capture/ingest/takeoff_height.h"

#include <algorithm>
#include <vector>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/order_statistics.h"
#include "tileflight/world/ground_truth/truth_folder.h"
#include "tileflight/world/place/extract.h"
#include "tileflight/world/scene/scene.h"

namespace tileflight::ingest {
namespace {

using geometry::Vec3;

constexpr double kMaxGroundHeight_m = 2.0;  ///< typical barometer drift before take-off
constexpr double kSampleRadius_m = 2.0;
constexpr int kSteps = 2;  ///< grid steps on each side

const flight_logs::TelemetryFix& find_ground_fix(const flight_logs::Telemetry& telemetry,
                                                 const std::filesystem::path& log) {
  const auto found = std::ranges::find_if(telemetry.fixes, [](const flight_logs::TelemetryFix& fix) {
    return fix.height_above_takeoff_m && *fix.height_above_takeoff_m <= kMaxGroundHeight_m;
  });
  if (found != telemetry.fixes.end()) return *found;
  throw InputError(log.string(),
                   "has no position within 2 m of its take-off height, so the take-off point is unknown; give its "
                   "height: --takeoff-height (takeoff_height in an experiment)");
}

/// Heights of the uppermost surface on a grid around a position; empty without a surface.
std::vector<double> surface_heights(const scene::Scene& scene, const Vec3& place) {
  const double top = scene.bounds().max().z() + 1.0;
  std::vector<double> heights;
  for (int j = -kSteps; j <= kSteps; ++j) {
    for (int i = -kSteps; i <= kSteps; ++i) {
      const Vec3 above(place.x() + kSampleRadius_m * i / kSteps, place.y() + kSampleRadius_m * j / kSteps, top);
      if (const auto hit = scene.intersect({above, -Vec3::UnitZ()})) heights.push_back(top - hit->distance_m);
    }
  }
  return heights;
}

}  // namespace

geometry::EllipsoidalHeight estimate_takeoff_height(const flight_logs::Telemetry& telemetry,
                                                    const std::filesystem::path& log,
                                                    const std::filesystem::path& truth) {
  const flight_logs::TelemetryFix& fix = find_ground_fix(telemetry, log);
  const auto origin = place::read_extract_json(truth).origin;
  if (!origin) {
    throw InputError(truth.string(),
                     "is not georeferenced, so the take-off point cannot be located in it; give its height: "
                     "--takeoff-height (takeoff_height in an experiment)");
  }
  geometry::TriangleMesh mesh = ground_truth::read_ground_truth(truth).mesh;
  if (mesh.triangles.empty())
    throw InputError(truth.string(), "has no surface to take the height of the take-off point from");
  std::vector<imaging::TexturedMesh> meshes(1);
  meshes[0].mesh = std::move(mesh);
  const scene::Scene scene(std::move(meshes));
  const geometry::LocalFrame frame(*origin);
  const Vec3 place = frame.local_from_geodetic({fix.latitude_deg, fix.longitude_deg, origin->height});
  const std::vector<double> heights = surface_heights(scene, place);
  if (heights.empty()) {
    throw InputError(log.string(),
                     "took off outside the ground truth; give the height of the take-off point: --takeoff-height "
                     "(takeoff_height in an experiment), or extract a larger region");
  }
  const Vec3 ground(place.x(), place.y(), base::upper_median(heights));
  return {frame.geodetic_from_local(ground).height.m - *fix.height_above_takeoff_m};
}

}  // namespace tileflight::ingest
