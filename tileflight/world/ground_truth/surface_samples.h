#pragma once

#include <cstdint>
#include <functional>

#include "tileflight/core/geometry/mesh.h"
#include "tileflight/core/geometry/point_cloud.h"
#include "tileflight/core/geometry/trajectory.h"
#include "tileflight/core/imaging/camera.h"
#include "tileflight/world/scene/scene.h"

namespace tileflight::ground_truth {

/// Samples points with their triangle's normal, uniformly by area: `per_m2` points per square metre on average,
/// stratified along each triangle's area, clipped to the box. A triangle's samples depend only on its corners, the box
/// and the seed, and their order (sort_by_position) only on themselves: a mesh sampled in parts gives the same points.
geometry::PointCloud sample_surface(const geometry::TriangleMesh& mesh, const geometry::Box3& box, double per_m2,
                                    std::uint64_t seed = 1);

/// Returns the area of a mesh within a box, m².
double area_within(const geometry::TriangleMesh& mesh, const geometry::Box3& box);

/// Tells whether a sample is wanted.
using SampleFilter = std::function<bool(const geometry::Vec3&)>;

/// Returns those of sample_surface()'s points that are wanted and lie on triangles whose bounds intersect `part`,
/// bit-identical and in the same order: a camera often sees only a small part of a large place. `wanted` is called from
/// several threads; empty: all.
geometry::PointCloud sample_surface_near(const geometry::TriangleMesh& mesh, const geometry::Box3& box,
                                         const geometry::Box3& part, double per_m2, std::uint64_t seed = 1,
                                         const SampleFilter& wanted = {});

/// Default maximum viewing range of cameras.
inline constexpr double kDefaultViewRange_m = 500.0;

/// Returns a box that contains everything within that range of any of the poses.
geometry::Box3 view_range_bounds(const geometry::Trajectory& poses, double max_range_m = kDefaultViewRange_m);

/// Returns for each point whether at least one pose's camera sees it: inside the image and the lens's valid cone, in
/// front, nearer than `max_range_m`, and not occluded (a ray to within `tolerance_m` of it).
std::vector<bool> compute_visibility(const scene::Scene& scene, const geometry::PointCloud& points,
                                     const geometry::Trajectory& poses, const imaging::Camera& camera,
                                     double max_range_m = kDefaultViewRange_m, double tolerance_m = 0.05);

}  // namespace tileflight::ground_truth
