#include "tileflight/capture/sensors/range_finder.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/random_numbers.h"
#include "tileflight/core/geometry/decompositions.h"

namespace tileflight::sensors {
namespace {

using geometry::SE3;
using geometry::Vec3;

constexpr std::uint64_t kRangeNoise = 41;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// Unit rays spread evenly over a cone about +z, the first along its axis: a Fibonacci (sunflower) spiral on the sphere
/// (Vogel, Mathematical Biosciences 44, 1979).
std::vector<Vec3> cone_rays(double width_rad, int rays) {
  std::vector<Vec3> directions;
  for (int i = 0; i < rays; ++i) {
    const double radius = rays > 1 ? width_rad / 2 * std::sqrt(static_cast<double>(i) / (rays - 1)) : 0.0;
    const double turn = i * std::numbers::pi * (3.0 - std::sqrt(5.0));
    directions.emplace_back(std::sin(radius) * std::cos(turn), std::sin(radius) * std::sin(turn), std::cos(radius));
  }
  return directions;
}

double nearest_m(const scene::Scene& scene, const Vec3& origin, const Eigen::Quaterniond& R_local_beam,
                 const std::vector<Vec3>& rays, double reach_m) {
  double nearest = kInfinity;
  for (const Vec3& ray : rays) {
    const auto hit = scene.intersect({origin, R_local_beam * ray}, std::min(nearest, reach_m));
    if (hit) nearest = std::min(nearest, hit->distance_m);
  }
  return nearest;
}

/// The reading for a true distance.
double reading_m(double distance_m, double normal, const RangeFinderOptions& options) {
  const double range_m = distance_m + normal * std::hypot(options.noise_m, options.noise_share * distance_m);
  if (!(range_m <= options.max_range_m)) return kInfinity;
  return range_m < options.min_range_m ? -kInfinity : range_m;
}

}  // namespace

void check(const RangeFinderOptions& options) {
  base::require(options.direction.allFinite() && options.direction.norm() > 1e-9, "range finder direction",
                "must not be zero");
  base::require(options.beam_width_deg >= 0.0 && options.beam_width_deg < 180.0, "range finder beam_width",
                "must be 0 to 180 degrees");
  base::require(options.rays >= 1 && options.rays <= 10000, "range finder rays", "must be 1 to 10000");
  base::require(options.min_range_m >= 0.0 && options.max_range_m > options.min_range_m, "range finder max_range",
                "must be more than min_range");
  base::require(options.noise_m >= 0.0 && options.noise_share >= 0.0, "range finder noise", "must be 0 or more");
}

std::vector<RangeSample> simulate_range_finder(const scene::Scene& scene, const render::PoseFunction& T_local_camera_at,
                                               const flight_path::SampleTimes& times, std::uint64_t first,
                                               std::uint64_t last, const RangeFinderOptions& options) {
  check(options);
  const std::vector<Vec3> rays = cone_rays(options.beam_width_deg * std::numbers::pi / 180.0, options.rays);
  const std::uint64_t key = base::stream_key(options.seed, kRangeNoise);
  const Eigen::Quaterniond R_own_beam = geometry::rotation_between(Vec3::UnitZ(), options.direction);
  const double reach_m = 1.5 * options.max_range_m;  // noise can bring slightly larger distances into the range
  std::vector<RangeSample> samples;
  for (std::uint64_t i = first; i < last; ++i) {
    const SE3 T_local_camera = T_local_camera_at(times.at(i));
    const Eigen::Quaterniond R_local_beam =
        options.direction_is_local ? R_own_beam : T_local_camera.rotation * R_own_beam;
    const double distance_m = nearest_m(scene, T_local_camera * options.position_camera, R_local_beam, rays, reach_m);
    samples.push_back({times.at(i), reading_m(distance_m, base::normal_variates(key, i)[0], options)});
  }
  return samples;
}

}  // namespace tileflight::sensors
