#pragma once

// Does a placed map look from its own viewpoints as the surface looks from there? Along each point's ray the surface
// must come first where the point is: not before it (the camera would have seen through a surface: free space) and not
// beyond it (the point would float). Nothing that registers nearest points minimises this.

#include <functional>
#include <optional>
#include <vector>

#include "tileflight/alignment/observed_points.h"
#include "tileflight/geometry/mesh.h"

namespace tileflight::alignment {

/// Distance to the first surface along a unit ray, metres; nullopt where there is none within `reach_m`. May be called
/// from several threads at once.
using RayCast =
    std::function<std::optional<double>(const geometry::Vec3& origin, const geometry::Vec3& direction, double reach_m)>;

struct RayAgreementOptions {
  std::size_t rays = 3000;        ///< at most so many points, evenly
  double least_tolerance = 0.02;  ///< of a distance's deviation, as a share of it; else three of the point's sigmas
  std::vector<geometry::Box3> regions{};  ///< only points inside any of these count; none: all
};

struct RayAgreement {
  double score = 0.0;     ///< mean over the points of 1 - (deviation / tolerance)^2, not below zero; less one for each
                          ///< that is blocked: at most 1, and a map at a wrong place is near or below zero
  double agreeing = 0.0;  ///< share of the points whose ray meets the surface within the tolerance
  double blocked = 0.0;   ///< share whose ray meets a surface clearly before the point
  double floating = 0.0;  ///< share whose ray meets none, or one beside the point
  std::size_t rays = 0;   ///< points that counted
  std::vector<double> block_scores;  ///< means over the points of each keyframe, for how sure a difference is
};

/// nullopt where the points have no viewpoints, or none of them counts.
std::optional<RayAgreement> ray_agreement(const ObservedPoints& points, const geometry::Sim3& T_local_map,
                                          const RayCast& cast, const RayAgreementOptions& options = {});

}  // namespace tileflight::alignment
