#pragma once

// Warnings about a tracked flight, derived from the images alone.

#include <functional>
#include <optional>

#include "tileflight/core/base/warning.h"
#include "tileflight/core/imaging/camera.h"
#include "tileflight/slam/odometry/odometry.h"
#include "tileflight/slam/odometry/run_comparison.h"

namespace tileflight::odometry {

/// Thresholds above which a warning is reported. Measured on the flights of the proving ground (tests/proving_ground);
/// docs/trust.md describes them.
struct WarningThresholds {
  double min_tracked_share = 0.95;        ///< share of the images
  double few_missing_share = 0.2;         ///< of the images: as many without a pose leave a verdict on the rest
  std::int64_t min_frames = 20;           ///< tracked frames; fewer are not enough for a judgement
  double saturated_share = 0.13;          ///< share of an image's points with a residual above the cut-off
  double saturated_likely_share = 0.3;    ///< from which on, or from that share of the images on with more than the one
  double saturated_likely_frames = 0.05;  ///< above, the warning is more than Severity::kNote
  double sigma_log_scale = 0.0013;        ///< standard deviation of log(scale at the end / scale at the start)
  double velocity_change = 1.5;           ///< between two images, in units of the flight's 95th percentile of speed
  double systematic_px = 0.04;  ///< displacement common to the keyframes; from `systematic_likely_px` on the warning is
                                ///< more than Severity::kNote
  double systematic_likely_px = 0.15;
  double systematic_sigmas = 2.0;
  double sigma_metric_scale = 0.01;  ///< the same where stereo cameras give the scale, of its middle value
  double rig_rotation_rad = 0.0044;  ///< of a rig's camera against its calibration (a quarter of a degree)
  double unmatched_share = 0.2;      ///< of the keyframes, without a match in a camera's picture
  double disagreement = 0.007;       ///< between the forward and backward runs, as a share of the path length
};

/// Returns the warnings about a run, the most severe first; empty for a flight that went well. `frames`: number of
/// input images; `name_of`: image name for an InputFrame::index. `second`: agreement with a second run, if there was
/// one.
Warnings find_warnings(const OdometryResult& result, std::int64_t frames,
                       const std::function<std::string(std::int64_t)>& name_of,
                       const std::optional<RunAgreement>& second = {}, const WarningThresholds& limits = {});

/// Returns those of find_warnings() that concern the trajectory as a whole: the two directions disagree, or the scale
/// may have drifted. An independent measurement of the trajectory answers them.
Warnings find_path_warnings(const OdometryResult& result, const std::function<std::string(std::int64_t)>& name_of,
                            const std::optional<RunAgreement>& second = {}, const WarningThresholds& limits = {});

/// Returns a warning if the odometry changed the focal length by more than its standard deviation explains. Images
/// straight down over level ground hardly show it, and heights change with it.
Warnings focal_warnings(const imaging::Camera& given, const imaging::Camera& estimated, double focal_sigma);

/// Returns whether find_warnings() finds any in a run alone, without a second one.
bool has_own_warnings(const OdometryResult& result, const WarningThresholds& limits = {});

/// Tells which of two runs over the same images to use.
enum class RunChoice {
  kFirst,         ///< the second agrees, is too short to judge, or is worse by its own residuals and warnings
  kSecond,        ///< the first has far fewer poses, or is worse by its own residuals and warnings
  kRatherSecond,  ///< they disagree, and only the second has no warnings of its own, though it fits no better: use it,
                  ///< with a warning
  kOpen           ///< they disagree and neither is better: use the first, with a warning
};

/// Chooses between two runs over the same images. A run is the worse one if it has warnings and the other has none, and
/// its median image residual is larger by a tenth; rather the worse one if that residual is not smaller by a tenth.
/// `agreement`: between both trajectories at the same times.
RunChoice choose_run(const OdometryResult& first, const OdometryResult& second,
                     const std::optional<RunAgreement>& agreement, const WarningThresholds& limits = {});

}  // namespace tileflight::odometry
