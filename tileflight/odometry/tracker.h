#pragma once

// Direct image alignment of a new picture to a keyframe: section 3.1, step 1 of the paper. Eight unknowns (pose,
// light), coarse to fine.

#include <array>
#include <limits>
#include <vector>

#include "tileflight/geometry/transform.h"
#include "tileflight/odometry/options.h"
#include "tileflight/odometry/pyramid.h"
#include "tileflight/odometry/rolling_shutter.h"

namespace tileflight::odometry {

/// A pixel of the keyframe whose inverse distance is known.
struct ReferencePoint {
  Eigen::Vector2f pixel;  ///< level 0
  float rho = 0.0F;       ///< along the pixel's ray, in the keyframe
  float weight = 1.0F;    ///< information of rho, for averaging on coarser levels
};

/// The pixels of one level that are aligned, as arrays; filled up with pixels of no meaning to whole vectors of lanes.
struct ReferenceLevel {
  std::vector<Eigen::Vector2f> pixels;    ///< of the meaningful ones only
  std::array<std::vector<float>, 3> ray;  ///< unit, by coordinate
  std::vector<float> rho;
  std::vector<float> intensity;

  std::size_t size() const { return pixels.size(); }
  Eigen::Vector3f ray_of(std::size_t i) const { return {ray[0][i], ray[1][i], ray[2][i]}; }
  void add(const Eigen::Vector2f& pixel, const Eigen::Vector3f& unit_ray, float inverse_distance, float grey);
  void fill_up();  ///< to be called once after the last one
};

struct TrackingReference {
  std::vector<ReferenceLevel> levels;
};

/// Averages the points on each level and spreads them to neighbouring pixels, so that coarse levels are dense enough.
TrackingReference make_reference(const LensPyramid& lens, const Pyramid& keyframe,
                                 const std::vector<ReferencePoint>& points);

/// Unknowns of the alignment: I_target = e^a I_reference + b.
struct AlignmentState {
  geometry::SE3 T_target_reference;
  double a = 0.0;
  double b = 0.0;
};

struct AlignmentResult {
  AlignmentState state;
  bool converged = false;        ///< enough pixels seen and a residual that is a tracking
  std::vector<double> rmse;      ///< grey values, by level; infinite on levels not reached
  double inside_share = 0.0;     ///< of the reference's pixels that fall into the target (level 0)
  double saturated_share = 0.0;  ///< of those, residual above the cut-off
  Eigen::Matrix<double, 8, 8> information = Eigen::Matrix<double, 8, 8>::Zero();  ///< normal matrix of the finest level

  double finest_rmse() const { return rmse.empty() ? std::numeric_limits<double>::infinity() : rmse.front(); }
};

/// Aligns from `start`. Gives up early (not converged) when a level's RMSE is above `give_up_rmse` of that level (may
/// be empty). Stops at `finest_level`; then the shares are that level's, and `converged` stays false above level 0.
/// With a rolling shutter each row of the target has its own pose; the one that is looked for is the middle row's, and
/// the velocity moves with it. The reference is a global shutter's.
AlignmentResult align(const LensPyramid& lens, const TrackingReference& reference, const Pyramid& target,
                      const AlignmentState& start, const TrackingOptions& options,
                      const std::vector<double>& give_up_rmse = {}, int finest_level = 0,
                      const RollingShutter& shutter = {});

/// Root mean square optical flow between reference and target, pixels of level 0: by translation alone, and by all
/// motion.
struct OpticalFlow {
  double translation_px = 0.0;
  double full_px = 0.0;
};
OpticalFlow optical_flow(const LensPyramid& lens, const TrackingReference& reference,
                         const geometry::SE3& T_target_reference);

}  // namespace tileflight::odometry
