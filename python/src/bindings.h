#pragma once

#include <pybind11/pybind11.h>

#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <utility>
#include <vector>

#include "tileflight/core/geometry/geodesy.h"
#include "tileflight/tiles/tileset/load.h"
#include "tileflight/world/scene/scene.h"

// Declarations that the module's binding files share.

namespace tileflight::python {

/// Converts JSON to dictionaries, lists, texts, numbers and None.
pybind11::object to_python(const nlohmann::json& json);
/// Converts dictionaries, lists, texts, numbers, numpy's arrays and None to JSON. `name` is the argument's name for
/// messages. Throws ValueError for numbers that are not finite, TypeError for other objects.
nlohmann::json to_json(const pybind11::handle& object, const char* name);

/// A scene in memory, and what is known of its tiles. Objects that use it share it, so that it lives as long as they
/// do.
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
using SceneHandle = std::shared_ptr<LoadedScene>;

}  // namespace tileflight::python
