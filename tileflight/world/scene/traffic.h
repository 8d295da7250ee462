#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/world/scene/actor_path.h"
#include "tileflight/world/scene/models.h"
#include "tileflight/world/scene/placed_part.h"

namespace tileflight::base {
class StrictSection;
}

namespace tileflight::scene {

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
/// The same of a file.
std::vector<ActorPlan> read_actors(const std::filesystem::path& flight_file);

/// Pose of an actor at a time.
struct ActorState {
  geometry::SE3 T_local_actor;  ///< x forward, y left, z up
  geometry::Vec3 velocity_m_s;  ///< local frame
};

/// Cars and people on their ways through a place. Immutable; safe from several threads.
class Traffic {
 public:
  /// `ground`: see ActorPath. Throws InputError for a wrong plan (its name).
  Traffic(std::vector<ActorPlan> plans, const GroundHeight& ground);

  const std::vector<ActorPlan>& plans() const { return plans_; }
  ActorState state(std::size_t actor, double time_s) const;
  /// Around the actor, in its own axes.
  geometry::Box3 own_box(std::size_t actor) const;
  /// The actors in a scene whose time goes from `from_s` to `to_s`; in the order of the plans.
  std::vector<scene::PlacedPart> placed(double from_s, double to_s) const;

 private:
  std::vector<ActorPlan> plans_;
  std::vector<ActorPath> paths_;
  std::vector<std::shared_ptr<const scene::ScenePart>> parts_;
};

/// Some points of the ways of all plans, a step apart, at the given heights or `default_up_m`: around which the place
/// is wanted.
std::vector<geometry::Vec3> points_along(const std::vector<ActorPlan>& plans, double step_m, double default_up_m);

}  // namespace tileflight::scene
