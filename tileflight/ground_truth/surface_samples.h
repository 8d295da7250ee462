#pragma once

#include <cstdint>

#include "tileflight/geometry/mesh.h"
#include "tileflight/geometry/point_cloud.h"
#include "tileflight/geometry/trajectory.h"
#include "tileflight/imaging/camera.h"
#include "tileflight/scene/scene.h"

namespace tileflight::ground_truth {

/// Points evenly by area with the triangle's normal: stratified along the cumulative area, `per_m2` of them a square
/// metre, clipped to the box. The same seed gives the same points.
geometry::PointCloud sample_surface(const geometry::TriangleMesh& mesh, const geometry::Box3& box, double per_m2,
                                    std::uint64_t seed = 1);

/// Those of the points of sample_surface() that lie on triangles which meet `part`, the same to the bit and in the same
/// order: what a camera may see is a small part of a large place.
geometry::PointCloud sample_surface_near(const geometry::TriangleMesh& mesh, const geometry::Box3& box,
                                         const geometry::Box3& part, double per_m2, std::uint64_t seed = 1);

/// How far cameras see, where nothing else is said.
inline constexpr double kSeenWithin_m = 500.0;

/// Everything nearer than that to any of the poses lies in it.
geometry::Box3 reach_of(const geometry::Trajectory& poses, double max_range_m = kSeenWithin_m);

/// For each point, whether at least one pose's camera sees it: inside the image and the lens's valid cone, in front,
/// nearer than `max_range_m`, and nothing in between (a ray to within `tolerance_m` of it).
std::vector<bool> seen_by_camera(const scene::Scene& scene, const geometry::PointCloud& points,
                                 const geometry::Trajectory& poses, const imaging::Camera& camera,
                                 double max_range_m = kSeenWithin_m, double tolerance_m = 0.05);

}  // namespace tileflight::ground_truth
