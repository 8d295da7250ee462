#pragma once

#include <filesystem>
#include <memory>

#include "tileflight/data/dataset/dataset.h"
#include "tileflight/evaluation/registration/register_map.h"
#include "tileflight/world/scene/scene.h"

namespace tileflight::render {
class Appearance;  // appearance.h
}

namespace tileflight::scoring {

/// Localizes a flight's images in the textured place.
class PictureFinder {
 public:
  /// `scene` must outlive it. `path`: T_map_camera with the images' times.
  PictureFinder(const scene::Scene& scene, dataset::Dataset dataset, geometry::Trajectory path);
  ~PictureFinder();
  PictureFinder(const PictureFinder&) = delete;
  PictureFinder& operator=(const PictureFinder&) = delete;

  /// Localizes `pictures` images, evenly chosen along the path, each starting from its pose by the transform. Those
  /// that are not found are tried again from where a neighbour in time was found, so that the drift or breaks of a path
  /// show.
  registration::LocatedPictures operator()(const geometry::Sim3& T_local_map, std::size_t pictures,
                                           registration::PictureDetail detail) const;

  /// Appearance of the scene; shared because it holds a copy of all textures.
  std::shared_ptr<const render::Appearance> appearance() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tileflight::scoring
