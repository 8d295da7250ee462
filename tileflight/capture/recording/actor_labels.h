#pragma once

#include <cstddef>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "tileflight/capture/render/render_flight.h"
#include "tileflight/core/geometry/trajectory.h"
#include "tileflight/world/scene/traffic.h"

namespace tileflight::recording {

/// Writes the positions of a flight's actors and their visible parts: a file per frame, boxes/000000.json, and
/// coco.json for all frames. Frames may be added in any order, by several threads and processes.
class ActorLabels {
 public:
  /// `traffic` null: nothing is written.
  ActorLabels(std::filesystem::path dataset_folder, std::shared_ptr<const scene::Traffic> traffic);

  /// Throws InputError.
  void add(const render::FlightFrame& frame, const geometry::SE3& T_local_camera) const;
  /// Writes coco.json for all frames. `image_ending`: ".jpg" or ".png". Throws InputError.
  void finish(std::size_t frames, int width, int height, const char* image_ending) const;

 private:
  std::filesystem::path folder_;
  std::shared_ptr<const scene::Traffic> traffic_;
};

/// Position and size of an actor in one frame.
struct ActorBox {
  std::string actor;
  geometry::SE3 T_local_box;  ///< axes forward, left, up; origin in the middle
  geometry::Vec3 size_m;      ///< along these axes

  bool has_same_place(const ActorBox& other) const;
};

/// Tells whether a dataset has boxes of actors.
bool has_actor_boxes(const std::filesystem::path& dataset_folder);
/// Reads the boxes of all actors in a frame ("000000"). Throws InputError (file, key) if they are missing or
/// broken.
std::vector<ActorBox> read_actor_boxes(const std::filesystem::path& dataset_folder, const std::string& frame_id);

}  // namespace tileflight::recording
