#pragma once

#include <cstdint>

#include "tileflight/geometry/mesh.h"
#include "tileflight/geometry/point_cloud.h"
#include "tileflight/geometry/trajectory.h"
#include "tileflight/imaging/camera.h"
#include "tileflight/scene/scene.h"

namespace tileflight::ground_truth {

/// Samples points with their triangle's normal, uniformly by area: stratified along the cumulative area, `per_m2`
/// points per square metre, clipped to the box. Deterministic in the seed.
geometry::PointCloud sample_surface(const geometry::TriangleMesh& mesh, const geometry::Box3& box, double per_m2,
                                    std::uint64_t seed = 1);

/// The subset of sample_surface()'s points on triangles that intersect `part`, bit-identical and in the same order: a
/// camera often sees only a small part of a large place.
geometry::PointCloud sample_surface_near(const geometry::TriangleMesh& mesh, const geometry::Box3& box,
                                         const geometry::Box3& part, double per_m2, std::uint64_t seed = 1);

/// Default maximum viewing range of cameras.
inline constexpr double kDefaultViewRange_m = 500.0;

/// A box that contains everything within that range of any of the poses.
geometry::Box3 view_range_bounds(const geometry::Trajectory& poses, double max_range_m = kDefaultViewRange_m);

/// For each point, whether at least one pose's camera sees it: inside the image and the lens's valid cone, in front,
/// nearer than `max_range_m`, and not occluded (a ray to within `tolerance_m` of it).
std::vector<bool> compute_visibility(const scene::Scene& scene, const geometry::PointCloud& points,
                                     const geometry::Trajectory& poses, const imaging::Camera& camera,
                                     double max_range_m = kDefaultViewRange_m, double tolerance_m = 0.05);

}  // namespace tileflight::ground_truth
