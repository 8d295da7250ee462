#include "tileflight/evaluation/scoring/truth_surface.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <iterator>
#include <limits>
#include <string>
#include <utility>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/geometry/point_order.h"
#include "tileflight/evaluation/metrics/distances.h"
#include "tileflight/evaluation/metrics/normal_consistency.h"
#include "tileflight/evaluation/metrics/part_search.h"
#include "tileflight/world/ground_truth/surface_samples.h"
#include "tileflight/world/scene/scene.h"

namespace tileflight::scoring {
namespace {

using geometry::Box3;
using geometry::PointCloud;
using geometry::Vec3;
using ground_truth::NumberedMesh;

constexpr double kAnywhere = std::numeric_limits<double>::infinity();

/// The triangles whose bounds intersect the box, with only the vertices they use.
NumberedMesh crop_to_box(const NumberedMesh& whole, const Box3& box) {
  constexpr std::uint32_t kUnused = std::numeric_limits<std::uint32_t>::max();
  std::vector<std::uint32_t> new_index(whole.mesh.vertices.size(), kUnused);
  NumberedMesh part;
  for (std::size_t i = 0; i < whole.mesh.triangles.size(); ++i) {
    geometry::Triangle t = whole.mesh.triangles[i];
    Box3 around;
    for (const std::uint32_t corner : t) around.extend(whole.mesh.vertices[corner]);
    if (!box.intersects(around)) continue;
    for (std::uint32_t& corner : t) {
      std::uint32_t& moved = new_index[corner];
      if (moved == kUnused) {
        moved = static_cast<std::uint32_t>(part.mesh.vertices.size());
        part.mesh.vertices.push_back(whole.mesh.vertices[corner]);
      }
      corner = moved;
    }
    part.mesh.triangles.push_back(t);
    part.numbers.push_back(whole.numbers[i]);
  }
  return part;
}

/// Whether anything in the box may be within range of one of the poses.
bool is_in_range(const Box3& box, const geometry::Trajectory& poses) {
  constexpr double kRange2 = ground_truth::kDefaultViewRange_m * ground_truth::kDefaultViewRange_m;
  return !box.isEmpty() && std::ranges::any_of(poses.poses, [&](const geometry::StampedPose& pose) {
    return box.squaredExteriorDistance(pose.T_local_camera.translation) <= kRange2;
  });
}

void append(PointCloud part, PointCloud& all) {
  constexpr std::size_t kMost = 500'000'000;  // as of one part (surface_samples.h)
  if (part.size() + all.size() > kMost) {
    throw InputError("completeness_samples_per_m2",
                     "would give more than 500 million points: choose fewer, or give camera and poses of the flight");
  }
  if (all.empty()) {
    all = std::move(part);
    return;
  }
  std::ranges::move(part.positions, std::back_inserter(all.positions));
  std::ranges::move(part.normals, std::back_inserter(all.normals));
}

/// The nearest triangle so far to a chosen point.
struct NearestTriangle {
  double distance2 = kAnywhere;  ///< square metres
  std::uint64_t number = 0;      ///< in the whole truth
};

}  // namespace

const ground_truth::CenterIndex& VoxelCenters::index(std::size_t part) {
  if (part_ != part) {
    index_.reset();
    centers_ = {};
    centers_ = truth_.read_voxel_centers(part);
    index_.emplace(centers_.positions, truth_.voxel_m());
    part_ = part;
  }
  return *index_;
}

std::vector<double> VoxelCenters::distances(const PointCloud& points, const char* what) {
  metrics::require_scorable(points, what);
  std::vector<Box3> bounds;
  for (const std::size_t part : truth_.all_parts()) bounds.push_back(truth_.voxel_bounds(part));
  std::vector<double> distances(points.size(), kAnywhere);
  metrics::search_parts(
      points.positions, bounds, distances, [&](std::size_t part, const std::vector<std::uint32_t>& asked) {
        const ground_truth::CenterIndex& centers = index(part);
        const auto nearest = [&](const Vec3& p, double within_m) { return centers.nearest(p, within_m); };
        metrics::lower_reach(points.positions, asked, nearest, distances);
      });
  if (distances.front() == kAnywhere) throw InputError("voxel centres", "has no points; there is nothing to score");
  return distances;
}

TruthSurface::TruthSurface(const ground_truth::TruthFolder& truth) : truth_(truth) {}

const NumberedMesh& TruthSurface::mesh(std::size_t part) {
  if (part_ != part) {
    index_.reset();
    mesh_ = {};
    mesh_ = truth_.read_mesh(part);
    part_ = part;
  }
  return mesh_;
}

const geometry::TriangleIndex& TruthSurface::index(std::size_t part) {
  const NumberedMesh& held = mesh(part);
  if (!index_) index_.emplace(held.mesh);
  return *index_;
}

Box3 TruthSurface::bounds() {
  if (truth_.size() == 1) return geometry::bounds(mesh(0).mesh);
  Box3 all;
  for (const std::size_t part : truth_.all_parts()) {
    if (truth_.has_mesh(part)) all.extend(truth_.mesh_bounds(part));
  }
  return all;
}

SurfaceMatch TruthSurface::match(const PointCloud& map, const std::vector<std::uint32_t>& chosen, double within_m) {
  metrics::require_scorable(map, "map");
  std::vector<Box3> bounds;
  for (const std::size_t part : truth_.all_parts()) bounds.push_back(truth_.mesh_bounds(part));
  constexpr std::uint32_t kNotChosen = std::numeric_limits<std::uint32_t>::max();
  std::vector<std::uint32_t> place(map.size(), kNotChosen);  // among the chosen
  for (std::size_t k = 0; k < chosen.size(); ++k) place[chosen[k]] = static_cast<std::uint32_t>(k);
  SurfaceMatch match{std::vector<double>(map.size(), kAnywhere), std::vector<Vec3>(chosen.size(), Vec3::Zero())};
  std::vector<NearestTriangle> nearest_triangles(chosen.size());
  metrics::search_parts(map.positions, bounds, match.distances_m,
                        [&](std::size_t part, const std::vector<std::uint32_t>& asked) {
                          const geometry::TriangleIndex& triangles = index(part);
                          const auto nearest = [&](const Vec3& p, double limit_m) -> std::optional<double> {
                            const auto found = triangles.nearest(p, limit_m);
                            return found ? std::optional(found->distance_m) : std::nullopt;
                          };
                          metrics::lower_reach(map.positions, asked, nearest, match.distances_m);
                          tbb::parallel_for(std::size_t{0}, asked.size(), [&](std::size_t i) {
                            const std::uint32_t k = place[asked[i]];
                            if (k == kNotChosen) return;
                            const auto found = triangles.nearest(map.positions[asked[i]], within_m);
                            if (!found) return;
                            NearestTriangle& best = nearest_triangles[k];
                            const std::uint64_t number = mesh_.numbers[found->triangle];
                            // By squares, as within a part: roots of different ones may be equal.
                            const double distance2 = (found->position - map.positions[asked[i]]).squaredNorm();
                            if (distance2 > best.distance2 || (distance2 == best.distance2 && number > best.number))
                              return;
                            best = {distance2, number};
                            match.directions[k] = metrics::triangle_direction(mesh_.mesh, found->triangle);
                          });
                        });
  return match;
}

PointCloud TruthSurface::sample(const place::TruthRegion& region, double per_m2) {
  PointCloud samples;
  for (const std::size_t part : truth_.all_parts()) {
    if (!truth_.has_mesh(part)) continue;
    append(place::crop_to_region(ground_truth::sample_surface(mesh(part).mesh, region.box, per_m2), region), samples);
  }
  if (truth_.size() > 1) geometry::sort_by_position(samples);
  return samples;
}

PointCloud TruthSurface::sample_seen(const place::TruthRegion& region, double per_m2, const geometry::Trajectory& poses,
                                     const imaging::Camera& camera) {
  index_.reset();  // the rays need memory of their own
  const Box3 reach = ground_truth::view_range_bounds(poses);
  PointCloud samples;
  std::vector<NumberedMesh> occluders;
  for (const std::size_t part : truth_.all_parts()) {
    if (truth_.size() > 1 && !is_in_range(truth_.mesh_bounds(part), poses)) continue;
    const NumberedMesh& held = mesh(part);
    append(place::crop_to_region(ground_truth::sample_surface_near(held.mesh, region.box, reach, per_m2), region),
           samples);
    occluders.push_back(crop_to_box(held, reach));
  }
  if (truth_.size() > 1) geometry::sort_by_position(samples);
  std::vector<imaging::TexturedMesh> in_reach(1);
  in_reach[0].mesh = ground_truth::merge_in_order(occluders);
  occluders.clear();
  if (in_reach[0].mesh.triangles.empty()) return {};
  const scene::Scene scene(std::move(in_reach), bounds().center());
  return geometry::filter_points(samples, ground_truth::compute_visibility(scene, samples, poses, camera));
}

}  // namespace tileflight::scoring
