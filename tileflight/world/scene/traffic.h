#pragma once

namespace tileflight::base {
class StrictSection;
}

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "tileflight/core/geometry/transform.h"
#include "tileflight/world/scene/models.h"
#include "tileflight/world/scene/scene_part.h"

namespace tileflight::scene {

/// Height of the surface at a horizontal position of the local frame, not above `below_z`; nullopt: there is none.
using GroundHeight = std::function<std::optional<double>(double x, double y, double below_z)>;

/// A point of an actor's route.
struct PathPoint {
  geometry::Vec2 position;     ///< east, north, metres
  std::optional<double> up_m;  ///< height; with ground: of about the road, which then is the surface below it
  double speed_m_s = 1.0;      ///< at this place; between two it changes evenly along the way
};

/// Route of an actor.
struct ActorRoute {
  std::vector<PathPoint> points;  ///< at least one, which it stands on
  double yaw_deg = 0.0;           ///< heading clockwise from north, of one that stands
  double start_s = 0.0;           ///< when it leaves the first point, where it stands before
  bool loops = false;             ///< returns to the first point and repeats; else it stops at the last
  bool follows_ground = true;     ///< else it keeps the points' heights, and stays upright
  double length_m = 4.0;          ///< distances between which the ground's slope is taken: along the way, and across
  double width_m = 1.6;
};

/// Path of an actor that can be evaluated at any time: a cubic curve through the route's points (Catmull and Rom's,
/// 1974, by chord length), on the ground, with smooth heading. Immutable; safe from several threads.
class ActorPath {
 public:
  /// Lays out the route. `ground` may be empty for routes that do not follow it. Throws InputError (`name`): no point,
  /// points at one place, speeds that are not above 0, numbers that are not finite, no ground anywhere below the route.
  ActorPath(const ActorRoute& route, const GroundHeight& ground, const char* name);

  /// T_local_actor: x along the way, z up from the ground.
  geometry::SE3 pose(double time_s) const;
  geometry::Vec3 velocity(double time_s) const;  ///< local frame, m/s
  double length_m() const { return samples_.back().distance_m; }
  /// Returns the time that the route takes once; 0 for an actor that stands.
  double duration_s() const { return samples_.back().time_s; }

 private:
  struct Sample {
    double distance_m = 0.0, time_s = 0.0, speed_m_s = 0.0;
    geometry::Vec3 position;
    double heading_rad = 0.0;  ///< counter-clockwise from east, without jumps
    double pitch = 0.0;        ///< slope along the way, rad, positive uphill
    double roll = 0.0;         ///< slope across it, positive: left side up
  };

  void lay_out(const ActorRoute& route);
  void put_on_ground(const ActorRoute& route, const GroundHeight& ground, const char* name);
  double along_s(double time_s) const;  ///< since the start, or the last return to it
  std::pair<const Sample*, const Sample*> around(double time_s) const;
  Sample at(double time_s) const;

  std::vector<Sample> samples_;  ///< by time
  double start_s_ = 0.0;
  bool loops_ = false;
};

/// One entry of `actors:` in a FLIGHT file.
struct ActorPlan {
  std::string name;
  Model model = Model::kCar;
  std::optional<imaging::Rgb8> colour;
  std::uint64_t number = 0;  ///< chooses colours
  double scale = 1.0;
  ActorRoute route;
};

/// Reads the list `actors` of a FLIGHT file's section; empty without it. Throws InputError (file, line, key).
std::vector<ActorPlan> read_actors(base::StrictSection& flight);
/// Reads the list `actors` of a FLIGHT file. Throws InputError (file, line, key).
std::vector<ActorPlan> read_actors(const std::filesystem::path& flight_file);

/// Pose and velocity of an actor at a time.
struct ActorState {
  geometry::SE3 T_local_actor;  ///< x forward, y left, z up
  geometry::Vec3 velocity_m_s;  ///< local frame
};

/// Cars and people that move through a place. Immutable; safe from several threads.
class Traffic {
 public:
  /// Lays out all routes. `ground`: as for ActorPath. Throws InputError for a wrong plan (its name).
  Traffic(std::vector<ActorPlan> plans, const GroundHeight& ground);

  const std::vector<ActorPlan>& plans() const { return plans_; }
  ActorState state(std::size_t actor, double time_s) const;
  /// Returns the bounds of the actor, in its own axes.
  geometry::Box3 own_box(std::size_t actor) const;
  /// Returns the actors as parts of a scene whose time goes from `from_s` to `to_s`, in the order of the plans.
  std::vector<PlacedPart> placed(double from_s, double to_s) const;

 private:
  std::vector<ActorPlan> plans_;
  std::vector<ActorPath> paths_;
  std::vector<std::shared_ptr<const ScenePart>> parts_;
};

/// Returns points along the routes of all plans, a step apart, at the given heights or `default_up_m`: the place is
/// wanted around them.
std::vector<geometry::Vec3> points_along(const std::vector<ActorPlan>& plans, double step_m, double default_up_m);

}  // namespace tileflight::scene
