#pragma once

#include <cstddef>
#include <filesystem>
#include <memory>
#include <vector>

#include "tileflight/actors/traffic.h"
#include "tileflight/geometry/trajectory.h"
#include "tileflight/render/render_flight.h"

namespace tileflight::survey {

/// Writes where a flight's actors are and what of them is seen: a file of each frame, boxes/000000.json, and coco.json
/// of them all. Frames may be added in any order, by several threads and processes.
class ActorLabels {
 public:
  /// `traffic` null: nothing is written.
  ActorLabels(std::filesystem::path dataset_folder, std::shared_ptr<const actors::Traffic> traffic);

  /// Throws InputError.
  void add(const render::FlightFrame& frame, const geometry::SE3& T_local_camera) const;
  /// Writes coco.json of all frames. `image_ending`: ".jpg" or ".png". Throws InputError.
  void finish(std::size_t frames, int width, int height, const char* image_ending) const;

 private:
  std::filesystem::path folder_;
  std::shared_ptr<const actors::Traffic> traffic_;
};

}  // namespace tileflight::survey
