#pragma once

// Free-space check of a registered map. Along the ray from its viewpoint, each point must lie on the first surface: not
// behind it (the camera would have looked through a surface) and not in front of it (the point would float).
// Registration by nearest points does not minimise this, so it is an independent check.

#include <functional>
#include <optional>
#include <vector>

#include "tileflight/core/geometry/mesh.h"
#include "tileflight/evaluation/registration/observed_points.h"

namespace tileflight::registration {

/// Distance to the first surface along a unit ray, metres; nullopt if there is none within `reach_m`. Called from
/// several threads at once.
using RayCast =
    std::function<std::optional<double>(const geometry::Vec3& origin, const geometry::Vec3& direction, double reach_m)>;

struct RayAgreementOptions {
  std::size_t max_rays = 3000;  ///< maximum number of points, evenly chosen
  double min_tolerance = 0.02;  ///< smallest tolerance on a distance, relative; otherwise three sigmas of the point
  std::vector<geometry::Box3> regions{};  ///< only points inside any of these count; none: all
};

struct RayAgreement {
  double score = 0.0;  ///< mean over the points of max(0, 1 - (deviation / tolerance)^2), minus 1 for each blocked
                       ///< point; at most 1; near or below zero for a map at a wrong place
  double agreeing_share = 0.0;          ///< share of points whose ray hits the surface within the tolerance
  double blocked_share = 0.0;           ///< share whose ray hits a surface clearly in front of the point
  double floating_share = 0.0;          ///< share whose ray hits nothing, or a surface that is outside the tolerance
                                        ///< but does not block the point
  std::size_t rays = 0;                 ///< points evaluated
  std::vector<double> keyframe_scores;  ///< mean score of each keyframe, for the uncertainty of differences
};

/// Compares the distances of points along their rays with the first surface. Returns nullopt if the points have no
/// viewpoints or none is evaluated.
std::optional<RayAgreement> compute_ray_agreement(const ObservedPoints& points, const geometry::Sim3& T_local_map,
                                                  const RayCast& cast, const RayAgreementOptions& options = {});

}  // namespace tileflight::registration
