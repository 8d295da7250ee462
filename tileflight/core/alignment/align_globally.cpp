#include "tileflight/core/alignment/align_globally.h"

#include <algorithm>
#include <cmath>

#include "tileflight/core/alignment/align_map.h"
#include "tileflight/core/alignment/global_registration.h"
#include "tileflight/core/alignment/ordered_sum.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"

namespace tileflight::alignment {
using geometry::PointCloud;
using geometry::Sim3;
using geometry::TriangleMesh;
using geometry::Vec3;

namespace {

double area_m2(const TriangleMesh& mesh, const std::array<std::uint32_t, 3>& t) {
  const Vec3& o = mesh.vertices[t[0]];
  return 0.5 * (mesh.vertices[t[1]] - o).cross(mesh.vertices[t[2]] - o).norm();
}

/// Additive recurrence of Roberts's R2 sequence, folded into the triangle.
Vec3 low_discrepancy_point(const TriangleMesh& mesh, const std::array<std::uint32_t, 3>& t, std::size_t k) {
  constexpr double kFirst = 0.7548776662466927, kSecond = 0.5698402909980532;
  const auto n = static_cast<double>(k + 1);
  double u = std::fmod(0.5 + kFirst * n, 1.0), v = std::fmod(0.5 + kSecond * n, 1.0);
  if (u + v > 1.0) {
    u = 1.0 - u;
    v = 1.0 - v;
  }
  const Vec3& o = mesh.vertices[t[0]];
  return o + u * (mesh.vertices[t[1]] - o) + v * (mesh.vertices[t[2]] - o);
}

/// Closeness of the map to the target after the coarse steps: mean of max(0, 1 - (distance / tolerance)^2); the
/// tolerance is a hundredth of the aligned map's size.
class ClosenessMetric {
 public:
  ClosenessMetric(const PointCloud& map, const AlignmentTarget& target, const std::vector<Vec3>& target_points)
      : target_(target), nearest_(target_points) {
    const std::size_t stride = std::max<std::size_t>(1, map.size() / 4000);
    for (std::size_t i = 0; i < map.size(); i += stride) points_.push_back(map.positions[i]);
    for (const Vec3& p : points_) mean_ += p / static_cast<double>(points_.size());
    std::vector<double> distances;
    for (const Vec3& p : points_) distances.push_back((p - mean_).norm());
    std::ranges::nth_element(distances, distances.begin() + static_cast<std::ptrdiff_t>(distances.size() / 2));
    radius_ = distances[distances.size() / 2];
  }

  double evaluate(const Sim3& T) const {
    constexpr double kTolerance = 0.01;
    const double tolerance_m = kTolerance * T.scale * radius_;
    const double sum = ordered_sum<double>(points_.size(), [&](std::size_t begin, std::size_t end) {
      double part = 0.0;
      for (std::size_t i = begin; i < end; ++i) {
        const double ratio = distance_m(T * points_[i], tolerance_m) / tolerance_m;
        part += std::max(0.0, 1.0 - ratio * ratio);
      }
      return part;
    });
    return sum / static_cast<double>(points_.size());
  }

  /// Largest distance between the map's centre and outline under two transforms, as a share of its size.
  double separation(const Sim3& A, const Sim3& B) const {
    double most_m = (A * mean_ - B * mean_).norm();
    for (int axis = 0; axis < 3; ++axis) {
      const Vec3 rim = mean_ + radius_ * Vec3::Unit(axis);
      most_m = std::max(most_m, (A * rim - B * rim).norm());
    }
    return most_m / (A.scale * radius_);
  }

 private:
  double distance_m(const Vec3& p, double radius_m) const {
    if (target_.index) {
      const auto hit = target_.index->nearest(p, radius_m);
      return hit ? hit->distance_m : radius_m;
    }
    const auto hit = nearest_.nearest(p, radius_m);
    return hit ? hit->distance_m : radius_m;
  }

  const AlignmentTarget& target_;
  geometry::NearestIndex nearest_;
  std::vector<Vec3> points_;
  Vec3 mean_ = Vec3::Zero();
  double radius_ = 0.0;
};

struct RankedAlignment {
  Sim3 T;
  double closeness = 0.0;
};

/// Refines the best candidates by the coarse steps; closest first.
std::vector<RankedAlignment> refine_candidates(const PointCloud& map, const GlobalRegistration& found,
                                               const AlignmentTarget& target, const AlignMapOptions& options,
                                               const ClosenessMetric& closeness) {
  constexpr double kWorthALook = 0.6;  // of the best candidate's overlap; chosen by hand
  constexpr std::size_t kMost = 4;
  std::vector<RankedAlignment> places;
  for (const GlobalCandidate& c : found.candidates) {
    if (places.size() == kMost || c.overlap < kWorthALook * found.candidates.front().overlap) break;
    AlignMapOptions about = options;
    about.icp.scale_center = c.T_target_source.scale;
    about.scale_seeds = {1.0};
    const Sim3 T = align_coarsely(map, c.T_target_source, target, about).T_local_map;
    places.push_back({T, closeness.evaluate(T)});
  }
  std::ranges::stable_sort(
      places, [](const RankedAlignment& a, const RankedAlignment& b) { return a.closeness > b.closeness; });
  return places;
}

std::string rival_note(const std::vector<RankedAlignment>& places, const ClosenessMetric& closeness) {
  constexpr double kAsGood = 0.9, kElsewhere = 0.05;
  for (std::size_t k = 1; k < places.size(); ++k) {
    const double apart = closeness.separation(places[0].T, places[k].T);
    if (places[k].closeness < kAsGood * places[0].closeness || apart < kElsewhere) continue;
    return base::formatted("ambiguous: another position, %.2g map sizes away, fits nearly as well", apart);
  }
  return {};
}

std::vector<Vec3> sample_target(const AlignmentTarget& target) {
  constexpr std::size_t kSurfacePoints = 100000;
  return target.mesh ? sample_surface_evenly(*target.mesh, kSurfacePoints) : target.cloud->positions;
}

}  // namespace

std::vector<Vec3> sample_surface_evenly(const TriangleMesh& mesh, std::size_t count) {
  double whole_m2 = 0.0;
  for (const auto& t : mesh.triangles) whole_m2 += area_m2(mesh, t);
  if (!(whole_m2 > 0.0)) return {};
  std::vector<Vec3> points;
  const double each_m2 = whole_m2 / static_cast<double>(count);
  double owed_m2 = 0.5 * each_m2;
  for (const auto& t : mesh.triangles) {
    for (owed_m2 += area_m2(mesh, t); owed_m2 >= each_m2; owed_m2 -= each_m2)
      points.push_back(low_discrepancy_point(mesh, t, points.size()));
  }
  return points;
}

double compute_closeness(const PointCloud& map, const Sim3& T_local_map, const AlignmentTarget& target) {
  return ClosenessMetric(map, target, sample_target(target)).evaluate(T_local_map);
}

MapAlignment align_map_globally(const PointCloud& map, const std::optional<Vec3>& map_up, const AlignmentTarget& target,
                                const AlignMapOptions& options, const Progress& progress) {
  if (!target.mesh && !target.cloud)
    throw InputError("global registration", "needs a ground-truth mesh or cloud to register to");
  const std::vector<Vec3> points = sample_target(target);
  GlobalRegistrationOptions search;
  search.source_up = map_up;
  if (map_up) search.target_up = Vec3::UnitZ();
  if (options.icp.scale == ScaleMode::kFixed) search.min_scale = search.max_scale = 1.0;
  report_progress(progress, 0, 3, "searching for the map's position");
  const GlobalRegistration found = register_globally(map.positions, points, search);
  if (found.candidates.empty()) {
    throw InputError("global registration",
                     "found no position where the map resembles the ground truth; give telemetry or a start");
  }
  report_progress(progress, 1, 3, "searching for the map's position");
  const ClosenessMetric closeness(map, target, points);
  const std::vector<RankedAlignment> places = refine_candidates(map, found, target, options, closeness);
  report_progress(progress, 2, 3, "searching for the map's position");
  AlignMapOptions from_there = options;
  from_there.scale_seeds = {1.0};
  MapAlignment alignment = align_map(map, places.front().T, target, from_there, progress);
  const std::string note = rival_note(places, closeness);
  if (!note.empty()) alignment.result.note += (alignment.result.note.empty() ? "" : "; ") + note;
  alignment.closeness = closeness.evaluate(alignment.result.T_target_source);
  return alignment;
}

}  // namespace tileflight::alignment
