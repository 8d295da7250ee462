#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/core/geometry/trajectory.h"
#include "tileflight/world/scene/traffic.h"

namespace tileflight::scene {

class Scene;

/// Frames at which a camera meets actors, and the names of these actors in the order of the frames. An actor is its box
/// at that time.
struct Encounters {
  std::vector<std::size_t> inside;   ///< the camera is in a box
  std::vector<std::size_t> through;  ///< on the way to the next frame it enters or crosses one, or one drives over it
  std::vector<std::string> inside_of, through_what;
};

/// Finds the frames at which a camera meets actors. The camera's path from a frame to the next is followed in eight
/// steps in each actor's own axes, in which both movements are one. `pose_at`: T_local_camera between the frames;
/// empty: straight on.
Encounters find_encounters(const Traffic& traffic, const geometry::Trajectory& frames,
                           const std::function<geometry::SE3(double time_s)>& pose_at);

/// Intersection of a segment with the surface of an actor.
struct ActorHit {
  std::size_t actor = 0;
  double distance_m = 0.0;  ///< from the segment's start
  geometry::Vec3 normal;    ///< unit length, local frame, of either sign
};

/// Surfaces of all actors at one time, for rays.
class ActorSurfaces {
 public:
  explicit ActorSurfaces(std::shared_ptr<const Traffic> traffic);
  ~ActorSurfaces();

  void set_time(double time_s);
  /// Returns the first surface on the segment; if several are equally near, that of the first actor.
  std::optional<ActorHit> first_hit(const geometry::Vec3& from, const geometry::Vec3& to) const;

 private:
  struct Placed {
    Eigen::Affine3d own_local;  ///< local frame to the model's coordinates
    geometry::Vec3 center;
    double radius_m = 0.0;
  };
  std::shared_ptr<const Traffic> traffic_;
  std::vector<std::shared_ptr<const Scene>> models_;  ///< of each actor
  std::vector<Placed> placed_;
};

}  // namespace tileflight::scene
