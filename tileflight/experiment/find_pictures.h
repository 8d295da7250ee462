#pragma once

#include <filesystem>
#include <memory>

#include "tileflight/alignment/register_map.h"
#include "tileflight/dataset/dataset.h"
#include "tileflight/scene/scene.h"

namespace tileflight::sensors {
class Appearance;  // appearance.h
}

namespace tileflight::experiment {

/// Looks for a flight's pictures in the textured place.
class PictureFinder {
 public:
  /// `scene` must outlive it. `path`: T_map_camera with the pictures' times.
  PictureFinder(const scene::Scene& scene, dataset::Dataset dataset, geometry::Trajectory path);
  ~PictureFinder();
  PictureFinder(const PictureFinder&) = delete;
  PictureFinder& operator=(const PictureFinder&) = delete;

  /// So many pictures, evenly over the path, each from where the transform puts it; those that are not found there once
  /// more from where a neighbour in time was found (a path that drifts or breaks is followed, so that it shows).
  alignment::LocatedPictures operator()(const geometry::Sim3& T_local_map, std::size_t pictures,
                                        alignment::PictureDetail detail) const;

  /// Of the scene: to be shared, as it holds all textures once more.
  std::shared_ptr<const sensors::Appearance> appearance() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tileflight::experiment
