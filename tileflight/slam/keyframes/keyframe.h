#pragma once

// State of the sliding window: keyframes, the points they host, and the estimates of each.

#include <array>
#include <cstdint>
#include <limits>
#include <memory>
#include <vector>

#include "tileflight/core/geometry/transform.h"
#include "tileflight/slam/keyframes/patch.h"
#include "tileflight/slam/keyframes/residual.h"

namespace tileflight::keyframes {

using geometry::SE3;
using Vec8 = Eigen::Matrix<double, 8, 1>;

/// Affine brightness of an image (DSO, eq. 4): (I - b) / e^a maps its grey values I to a common scale.
struct AffineBrightness {
  double a = 0.0;
  double b = 0.0;
};

/// A pixel whose inverse distance is still being searched for (tracer.h).
struct ImmaturePoint {
  enum class Status { kUntraced, kGood, kOutside, kOutlier, kSkipped, kBadCondition };

  Patch patch;
  float rho_min = 0.0F;
  float rho_max = std::numeric_limits<float>::quiet_NaN();  ///< NaN: unbounded (no depth yet)
  float quality = 1e4F;                                     ///< second-best over best match of the search
  float interval_px = 1e4F;                                 ///< length of the last search
  Status status = Status::kUntraced;
  int scale = 0;            ///< pyramid level at which it was selected
  int failed_searches = 0;  ///< searches without a match; the point is dropped after two
  std::array<std::uint8_t, 3> color{};

  bool has_depth() const { return std::isfinite(rho_max); }
  float rho() const { return 0.5F * (rho_min + rho_max); }
};

/// State of an active point's residual in one target keyframe.
struct Observation {
  int target = 0;  ///< slot of the keyframe in the window
  ResidualState state = ResidualState::kGood;
  bool counted = false;  ///< already included in the point's good_observations
  float energy = 0.0F;   ///< truncated at the threshold
  float raw_energy = 0.0F;
  Linearization linearization;
};

/// A camera beside the reference camera, exposed at the same instants (static stereo: Wang, Schwoerer, Cremers, "Stereo
/// DSO", ICCV 2017). The reference camera is the one whose pictures are keyframes.
struct StereoCamera {
  Lens lens;  ///< level 0
  SE3 T_stereo_reference;
};

/// More cannot be used: their brightness parameters fill one block of eight unknowns.
inline constexpr int kMaxStereoCameras = 4;

/// Image of a stereo camera at a keyframe's instant. Its brightness is relative to the keyframe's own picture: e^a I +
/// b of the stereo picture is where the keyframe has I.
struct StereoPicture {
  std::shared_ptr<const Pyramid> pyramid;  ///< level 0 is enough; null: no picture, or one that shows nothing
  AffineBrightness brightness_linear;
  AffineBrightness brightness_prior;
  Eigen::Vector2d brightness_information = Eigen::Vector2d::Zero();
  float energy_threshold = 8.0F * 12.0F * 12.0F;  ///< as that of a keyframe
};

/// A point in the window's optimisation.
struct ActivePoint {
  Patch patch;
  float rho = 0.0F;  ///< inverse distance from the host along its ray
  float rho_backup = 0.0F;
  float step = 0.0F;
  float information = 0.0F;   ///< of rho, from its residuals at the last solution
  int good_observations = 0;  ///< number of keyframes with a good residual so far
  std::array<ResidualState, 2> recent_states{ResidualState::kGood,
                                             ResidualState::kGood};  ///< in the newest keyframes, newest first
  float parallax_rad = 0.0F;                                         ///< largest angle between the host's ray and an
                                                                     ///< observing ray
  std::int64_t first_frame = 0;
  std::int64_t last_frame = 0;
  std::array<std::uint8_t, 3> color{};
  std::vector<Observation> observations;
  std::vector<Observation> stereo_observations;  ///< in the host's stereo pictures; `target`: index of the camera
};

/// One keyframe of the window. T_camera_map = exp(delta[0..5]) * T_camera_map_linear, brightness = brightness_linear +
/// delta[6..7]: Jacobians stay at the linearisation point (first-estimate Jacobians; DSO, section 2.3), values move
/// with delta.
struct Keyframe {
  int id = 0;                    ///< sequence number over all keyframes
  std::int64_t frame_index = 0;  ///< frame index in the dataset
  double time_s = 0.0;
  std::shared_ptr<const Pyramid> pyramid;
  SE3 T_camera_map_linear;
  AffineBrightness brightness_linear;
  Vec8 delta = Vec8::Zero();
  Vec8 delta_backup = Vec8::Zero();
  float energy_threshold = 8.0F * 12.0F * 12.0F;  ///< of one residual (eight pixels), squared grey values; 12^2 per
                                                  ///< pixel is the value of DSO's implementation
  AffineBrightness brightness_prior;              ///< mean of the brightness prior
  Eigen::Vector2d brightness_information = Eigen::Vector2d::Zero();
  bool to_marginalize = false;
  std::vector<ImmaturePoint> immature;
  std::vector<ImmaturePoint> out_of_view;  ///< left the newest keyframe's view; used for the dense map only
  std::vector<ActivePoint> points;
  std::int64_t activated_points = 0;  ///< points it has activated so far
  std::vector<StereoPicture> stereo;  ///< by camera of the window; empty in a window without stereo cameras
  Vec8 stereo_delta = Vec8::Zero();   ///< of (a, b) of each stereo picture, from its linearisation point
  Vec8 stereo_delta_backup = Vec8::Zero();

  SE3 T_camera_map() const { return SE3::exp(delta.head<6>()) * T_camera_map_linear; }
  AffineBrightness brightness() const { return {brightness_linear.a + delta[6], brightness_linear.b + delta[7]}; }
  /// Brightness of a stereo picture, relative to the keyframe's.
  AffineBrightness stereo_brightness(int camera) const {
    const AffineBrightness& linear = stereo[static_cast<std::size_t>(camera)].brightness_linear;
    return {linear.a + stereo_delta[2 * camera], linear.b + stereo_delta[2 * camera + 1]};
  }
};

/// Focal lengths and principal point as unknowns shared by all keyframes: value() = linear + delta, with first-estimate
/// Jacobians at `linear`, as for the poses.
struct IntrinsicsEstimate {
  bool estimated = false;  ///< if false there are no such unknowns and value() is zero
  IntrinsicsDelta linear = IntrinsicsDelta::Zero();
  IntrinsicsDelta delta = IntrinsicsDelta::Zero();
  IntrinsicsDelta delta_backup = IntrinsicsDelta::Zero();

  IntrinsicsDelta value() const { return linear + delta; }
  int unknowns() const { return estimated ? 4 : 0; }
};

/// The sliding window. The prior left by marginalised points and keyframes (DSO, eq. 19) is the energy delta^T H delta
/// + 2 b^T delta over the stacked deltas: 8 for each keyframe in the order of `keyframes`, oldest first; then 4 for the
/// intrinsics if they are estimated, or, with stereo cameras, 8 for the stereo pictures of each keyframe (two a camera,
/// the rest without information). A rig's calibration is taken as given: never both.
struct Window {
  std::vector<Keyframe> keyframes;
  IntrinsicsEstimate intrinsics;
  std::vector<StereoCamera> stereo_cameras;  ///< at most kMaxStereoCameras
  Eigen::MatrixXd H_prior;
  Eigen::VectorXd b_prior;

  int size() const { return static_cast<int>(keyframes.size()); }
  bool has_stereo() const { return !stereo_cameras.empty(); }
  /// First unknown of a keyframe's stereo pictures.
  int stereo_unknown(int slot) const { return 8 * (size() + slot); }
  int unknowns() const { return (has_stereo() ? 16 : 8) * size() + intrinsics.unknowns(); }
};

/// Transform and brightness transfer from host to target (DSO, eq. 4 and 6): gain = e^(a_t - a_h), offset = b_t - gain
/// b_h.
PairTransform pair_transform(const SE3& T_target_host, const AffineBrightness& host, const AffineBrightness& target);

/// Returns the pair transform from a keyframe to its stereo picture `camera`.
PairTransform stereo_transform(const Window& window, const Keyframe& keyframe, int camera);

}  // namespace tileflight::keyframes
