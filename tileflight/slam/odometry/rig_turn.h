#pragma once

// Finds how a rig's camera is turned against its calibration, about its vertical as well. Such a turn moves all corners
// along their epipolar lines, as another distance does, so that one instant cannot show it. Distances that the motion
// of the reference camera gives tell both apart: a turn moves near and far corners alike.

#include <optional>
#include <vector>

#include "tileflight/core/geometry/transform.h"
#include "tileflight/slam/odometry/odometry.h"

namespace tileflight::odometry {

/// A corner that both cameras see at one instant, with its distance by the motion of the reference camera.
struct RigCorner {
  geometry::Vec3 own;    ///< unit ray in the reference camera
  double rho = 0.0;      ///< inverse distance from it, of any scale
  geometry::Vec3 other;  ///< unit ray in the other camera, in the reference camera's axes by the calibration
};

/// Holds where another camera of the rig sees corners of the reference camera (find_in_other_camera()).
struct OtherView {
  geometry::Vec3 centre;  ///< of fit_rig_turn()
  std::vector<std::optional<geometry::Vec3>> rays;
};

/// Fit of the corners of one instant.
struct RigTurnFit {
  geometry::Vec3 turn_rad = geometry::Vec3::Zero();  ///< exp(turn) other are the rays that meet the corners
  geometry::Mat3 information = geometry::Mat3::Zero();
  double scale = 1.0;                                     ///< by which `rho` is multiplied to be in units of the rig
  geometry::Vec3 parallax_axis = geometry::Vec3::Zero();  ///< as RigTurn's
  double parallax_rad = 0.0;
  double pixel_rad = 0.0;
};

/// Fits turn and scale to the corners by their rays (Gauss-Newton, Cauchy). `centre`: T_other_reference's translation
/// in the reference camera's axes, so that own / rho + centre is the corner from the other camera. `pixel_rad`: angle
/// of a pixel. nullopt for fewer than 40 corners, or if no fit suits half of them.
std::optional<RigTurnFit> fit_rig_turn(const std::vector<RigCorner>& corners, const geometry::Vec3& centre,
                                       double pixel_rad);

/// Joins the fits of several instants: mean weighted by their information, with standard deviations from it or from how
/// far the fits differ, whichever is larger. nullopt if there are none.
std::optional<RigTurn> join_rig_turns(const std::vector<RigTurnFit>& fits);

}  // namespace tileflight::odometry
