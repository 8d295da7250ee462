#pragma once

// Flights that nobody chose: kind, height, lens, view and camera are drawn at random over a place.

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/core/geometry/trajectory.h"
#include "tileflight/core/geometry/triangle_index.h"
#include "tileflight/core/imaging/camera.h"
#include "tileflight/world/scene/scene.h"

namespace tileflight::proving_ground {

enum class FlightKind { kStraight, kArc, kOrbit, kLawnmower, kHoverAndTurn, kClimb };
enum class View { kNadir, kOblique, kShallow };
/// Data that the flight has beside its images.
enum class Aids { kPositions, kAttitude, kNothing };  ///< kAttitude: positions and attitude

std::string name_of(FlightKind kind);
std::string name_of(View view);
std::string name_of(Aids aids);

/// A drawn flight. Lengths are in metres, angles in degrees.
struct FlightDraw {
  FlightKind kind = FlightKind::kStraight;
  View view = View::kNadir;
  Aids aids = Aids::kPositions;
  int lens_deg = 90;        ///< horizontal field of view: 60 or 90 (pinhole), 155 (equidistant fisheye)
  double height_m = 30;     ///< above the highest surface near the path
  double heading_deg = 0;   ///< of the path's start, clockwise from north
  double view_yaw_deg = 0;  ///< of the camera, relative to the path (an orbit looks at its middle)
  double pitch_deg = -90;
  double turn_deg = 0;  ///< of an arc or orbit along the path, or of the camera in place; positive to the right
  double speed_m_s = 5;
  double fps = 8;
  int frames = 60;
  double sway_deg = 0;    ///< amplitude of the attitude's unrest
  double bank_deg = 0;    ///< roll into turns, as a camera without a gimbal has it
  bool degraded = false;  ///< rolling shutter, blur, noise, changing exposure, H.264
  std::uint64_t seed = 1;
};

/// The same seed draws the same flight.
FlightDraw draw_flight(std::uint64_t seed);

/// The camera of a draw: 640 x 480 pixels, the fisheye 800 x 450.
imaging::Calibration camera_of(const FlightDraw& draw);

/// The place that is flown over.
struct Ground {
  const scene::Scene& scene;
  const geometry::TriangleIndex& surface;
  geometry::Box3 region;  ///< flights stay over its middle nine tenths
};

/// Poses of the frames: the draw set down at a random spot where it keeps clear of every surface and sees enough of the
/// place. nullopt where none of a hundred spots will do.
std::optional<geometry::Trajectory> place_flight(const FlightDraw& draw, const Ground& ground);

}  // namespace tileflight::proving_ground
