#pragma once

// The state of the sliding window: keyframes, the points that they host, and what is known of each.

#include <array>
#include <cstdint>
#include <limits>
#include <memory>
#include <vector>

#include "tileflight/geometry/transform.h"
#include "tileflight/odometry/patch.h"
#include "tileflight/odometry/residual.h"

namespace tileflight::odometry {

using geometry::SE3;
using Vec8 = Eigen::Matrix<double, 8, 1>;

/// Light of a picture (eq. 4): its grey values I belong to the common ones by (I - b) / e^a.
struct AffineLight {
  double a = 0.0;
  double b = 0.0;
};

/// A pixel whose inverse distance is being found (tracer.h).
struct ImmaturePoint {
  enum class Status { kUntraced, kGood, kOutside, kOutlier, kSkipped, kBadCondition };

  Patch patch;
  float rho_min = 0.0F;
  float rho_max = std::numeric_limits<float>::quiet_NaN();  ///< NaN: unknown
  float quality = 1e4F;                                     ///< second-best over best match of the search
  float interval_px = 1e4F;                                 ///< length of the last search
  Status status = Status::kUntraced;
  int scale = 0;     ///< of its selection
  int failures = 0;  ///< searches without a match; two end it
  std::array<std::uint8_t, 3> color{};

  bool has_depth() const { return std::isfinite(rho_max); }
  float rho() const { return 0.5F * (rho_min + rho_max); }
};

/// How an active point's residual in one keyframe stands.
struct Observation {
  int target = 0;  ///< slot of the keyframe in the window
  ResidualState state = ResidualState::kGood;
  bool counted = false;  ///< in the point's good_observations
  float energy = 0.0F;   ///< not above the threshold
  float raw_energy = 0.0F;
  Linearization linearization;
};

/// A point in the window's optimisation.
struct ActivePoint {
  Patch patch;
  float rho = 0.0F;  ///< inverse distance from the host along its ray
  float rho_backup = 0.0F;
  float step = 0.0F;
  float information = 0.0F;   ///< of rho, from its residuals at the last solution
  int good_observations = 0;  ///< good residuals it has had, over all keyframes
  std::array<ResidualState, 2> recent{ResidualState::kGood,
                                      ResidualState::kGood};  ///< in the newest keyframes, newest first
  float parallax_rad = 0.0F;                                  ///< widest between host's ray and an observation
  std::int64_t first_frame = 0;
  std::int64_t last_frame = 0;
  std::array<std::uint8_t, 3> color{};
  std::vector<Observation> observations;
};

/// One picture of the window. T_camera_map = exp(delta[0..5]) * T_camera_map_linear, light = light_linear +
/// delta[6..7]: Jacobians stay at the linearisation point (first estimate), values move with delta.
struct Keyframe {
  int id = 0;                    ///< counts all keyframes
  std::int64_t frame_index = 0;  ///< of the dataset
  double time_s = 0.0;
  std::shared_ptr<const Pyramid> pyramid;
  SE3 T_camera_map_linear;
  AffineLight light_linear;
  Vec8 delta = Vec8::Zero();
  Vec8 delta_backup = Vec8::Zero();
  float energy_threshold = 8.0F * 12.0F * 12.0F;  ///< of one residual (eight pixels)
  AffineLight light_prior;                        ///< mean of the prior on the light
  Eigen::Vector2d light_information = Eigen::Vector2d::Zero();
  bool to_marginalize = false;
  std::vector<ImmaturePoint> immature;
  std::vector<ImmaturePoint> out_of_view;  ///< left the newest keyframe's view; of no use but for the map
  std::vector<ActivePoint> points;
  std::int64_t hosted = 0;  ///< points it has ever activated

  SE3 T_camera_map() const { return SE3::exp(delta.head<6>()) * T_camera_map_linear; }
  AffineLight light() const { return {light_linear.a + delta[6], light_linear.b + delta[7]}; }
};

/// Focal lengths and principal point as unknowns that all keyframes share: value() = linear + delta, with Jacobians at
/// `linear` (first estimate), as for the poses.
struct LensEstimate {
  bool estimated = false;  ///< else there are no such unknowns and value() is zero
  LensDelta linear = LensDelta::Zero();
  LensDelta delta = LensDelta::Zero();
  LensDelta delta_backup = LensDelta::Zero();

  LensDelta value() const { return linear + delta; }
  int unknowns() const { return estimated ? 4 : 0; }
};

/// The sliding window. The prior is what marginalised points and keyframes left behind: energy delta^T H delta + 2 b^T
/// delta over the stacked deltas (8 a keyframe, in the order of `keyframes`, oldest first; then the lens's, if it is
/// estimated).
struct Window {
  std::vector<Keyframe> keyframes;
  LensEstimate lens;
  Eigen::MatrixXd H_prior;
  Eigen::VectorXd b_prior;

  int size() const { return static_cast<int>(keyframes.size()); }
  int unknowns() const { return 8 * size() + lens.unknowns(); }
};

/// From host to target with the light between them (section 2.2): gain = e^(a_t - a_h), offset = b_t - gain b_h.
PairTransform pair_transform(const SE3& T_target_host, const AffineLight& host, const AffineLight& target);

}  // namespace tileflight::odometry
