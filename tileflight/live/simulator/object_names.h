#pragma once

#include <string>

#include "tileflight/capture/render/scene_objects.h"

namespace tileflight::simulator {

/// A name of word characters (letters, digits, `_`), as AirSim's scripts expect: their patterns are `[\w]*`. It depends
/// on `name` alone, so that it is the same whichever tiles are in memory. A name of words joined by single `-`, `/` or
/// `#` keeps its words, joined by one, two or three `_`; of any other name each foreign byte becomes `_`, and eight
/// hexadecimal digits of its SHA-256 follow, so that different names stay different.
std::string to_word_name(const std::string& name);

/// The name of a mesh of a tile for clients: its tile's file without the ending .glb, in word characters; "surface" for
/// a mesh without a name.
std::string tile_name(const std::string& mesh_name);

/// The name of an object for clients. A feature with a name of word characters alone keeps it, other names of features
/// are to_word_name(); a feature without a name is `FILE#NUMBER` in word characters; the rest of a tile is tile_name().
std::string client_name(const render::SceneObject& object);

}  // namespace tileflight::simulator
