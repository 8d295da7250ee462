#pragma once

#include <memory>
#include <optional>

#include "tileflight/core/geometry/geodesy.h"
#include "tileflight/world/scene/scene.h"
#include "tileflight/tiles/tileset/load.h"

namespace tileflight::python {

/// A scene in memory, with what is known of where it comes from. Objects that use it share it, so that it lives as long
/// as they do.
struct LoadedScene {
  LoadedScene(std::vector<imaging::TexturedMesh> meshes, tileset::LoadedTiles tiles,
              const std::optional<geometry::Vec3>& anchor = {})
      : scene(std::move(meshes), anchor), tiles(std::move(tiles)) {}

  scene::Scene scene;
  tileset::LoadedTiles tiles;  ///< without its meshes

  std::optional<geometry::Geodetic> origin() const {
    return tiles.local_frame ? std::optional(tiles.local_frame->origin()) : std::nullopt;
  }
};

}  // namespace tileflight::python
