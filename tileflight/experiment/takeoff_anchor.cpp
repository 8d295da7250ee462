#include "tileflight/experiment/takeoff_anchor.h"

#include <algorithm>
#include <vector>

#include "tileflight/experiment/extract.h"
#include "tileflight/geometry/input_error.h"
#include "tileflight/ground_truth/extract.h"
#include "tileflight/scene/scene.h"

namespace tileflight::experiment {
namespace {

using geometry::Vec3;

constexpr double kOnTheGround_m = 2.0;  ///< what a barometer drifts by before take-off
constexpr double kAround_m = 2.0;
constexpr int kSteps = 2;  ///< on each side

const flight::TelemetryFix& fix_on_the_ground(const flight::Telemetry& telemetry, const std::filesystem::path& log) {
  const auto found = std::ranges::find_if(telemetry.fixes, [](const flight::TelemetryFix& fix) {
    return fix.height_above_takeoff_m && *fix.height_above_takeoff_m <= kOnTheGround_m;
  });
  if (found != telemetry.fixes.end()) return *found;
  throw InputError(
      log.string(),
      "has no position within 2 m of its take-off height, so that the place it took off from is not known; "
      "say its height: --takeoff-height (takeoff_height in an experiment)");
}

/// Heights of the uppermost surface on a grid around a place; none where there is no surface.
std::vector<double> surface_heights(const scene::Scene& scene, const Vec3& place) {
  const double top = scene.bounds().max().z() + 1.0;
  std::vector<double> heights;
  for (int j = -kSteps; j <= kSteps; ++j) {
    for (int i = -kSteps; i <= kSteps; ++i) {
      const Vec3 above(place.x() + kAround_m * i / kSteps, place.y() + kAround_m * j / kSteps, top);
      if (const auto hit = scene.intersect({above, -Vec3::UnitZ()})) heights.push_back(top - hit->distance_m);
    }
  }
  return heights;
}

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace

geometry::EllipsoidalHeight takeoff_height(const flight::Telemetry& telemetry, const std::filesystem::path& log,
                                           const std::filesystem::path& truth) {
  const flight::TelemetryFix& fix = fix_on_the_ground(telemetry, log);
  const auto origin = origin_of(read_extract_json(truth));
  if (!origin) {
    throw InputError(truth.string(),
                     "is not georeferenced, so that the take-off place is not found in it; say its height: "
                     "--takeoff-height (takeoff_height in an experiment)");
  }
  geometry::TriangleMesh mesh = ground_truth::read_ground_truth(truth).mesh;
  if (mesh.triangles.empty()) throw InputError(truth.string(), "has no surface to find the take-off place's height on");
  std::vector<imaging::TexturedMesh> meshes(1);
  meshes[0].mesh = std::move(mesh);
  const scene::Scene scene(std::move(meshes));
  const geometry::LocalFrame frame(*origin);
  const Vec3 place = frame.local_from_geodetic({fix.latitude_deg, fix.longitude_deg, origin->height});
  const std::vector<double> heights = surface_heights(scene, place);
  if (heights.empty()) {
    throw InputError(
        log.string(),
        "took off outside of the ground truth; say that place's height: --takeoff-height (takeoff_height in "
        "an experiment), or extract a larger region");
  }
  const Vec3 ground(place.x(), place.y(), median(heights));
  return {frame.geodetic_from_local(ground).height.m - *fix.height_above_takeoff_m};
}

}  // namespace tileflight::experiment
