#pragma once

// Estimate of a rolling shutter's line delay from a window's residuals. A row that is exposed delta (v - (H - 1) / 2)
// seconds after the middle row has the pose exp(delta (v - (H - 1) / 2) w) T_camera_map, w the twist of T_camera_map a
// second. To first order the delay therefore moves a point from host row v_h to target row v_t as a change of the
// relative pose by delta (s_t w_t - s_h Ad(T_target_host) w_h), s the rows below the middle: du/d(delta) = J_pose times
// that. Focal lengths and principal point, which take up part of it, are unknowns beside the delay; the keyframes'
// poses and brightness and the points' distances are eliminated, each window for itself, so that windows may be added.

#include <optional>
#include <vector>

#include "tileflight/core/geometry/transform.h"
#include "tileflight/slam/keyframes/keyframe.h"
#include "tileflight/slam/mapping/line_delay_estimate.h"

namespace tileflight::mapping {

/// The energy x^T H x + 2 b^T x over x = (IntrinsicsDelta from the given camera, line delay in seconds beyond that
/// which the images were rectified with), squared grey values.
struct LineDelaySystem {
  using Vec5 = Eigen::Matrix<double, 5, 1>;
  Eigen::Matrix<double, 5, 5> H = Eigen::Matrix<double, 5, 5>::Zero();
  Vec5 b = Vec5::Zero();

  LineDelaySystem& operator+=(const LineDelaySystem& other) {
    H += other.H;
    b += other.b;
    return *this;
  }
};

/// Makes the equations of the line delay from the window's good residuals, as last linearised, without its prior.
/// `velocities`: of each keyframe, the left twist of T_camera_map a second (translation first, map units). `lens`:
/// level 0, as the window's. Intrinsics that are not estimated have no information. The window is a copy, since normal
/// equations set its points' information.
LineDelaySystem line_delay_system(keyframes::Window window, const keyframes::Lens& lens,
                                  const std::vector<geometry::Vec6>& velocities);

/// Estimates the line delay by least squares over all windows, in their order of time. The standard deviation is that
/// of estimates without one of up to 16 blocks of the flight (delete-block jackknife: Kuensch 1989), since residuals of
/// neighbouring windows are the same ones, and what is not modelled (lens, brightness, wrong distances) is alike for as
/// long as the motion is. `intrinsics`: information of the given ones. nullopt: too few windows.
std::optional<LineDelayEstimate> estimate_line_delay(const std::vector<LineDelaySystem>& windows,
                                                     const Eigen::Matrix4d& intrinsics);

}  // namespace tileflight::mapping
