#pragma once

#include <memory>
#include <string>

#include "tileflight/capture/render/scene_objects.h"

namespace tileflight::simulator {

/// A client's regular expression for whole names. Matching takes time linear in the name's length for any expression
/// (RE2: no backtracking), with bounded memory; features that need backtracking (backreferences, lookahead) are not
/// supported.
class NamePattern {
 public:
  enum class Case { kHeeded, kIgnored };

  /// Throws InputError: longer than 1000 characters, or not a valid expression.
  NamePattern(const std::string& expression, Case letters);
  ~NamePattern();
  NamePattern(const NamePattern&) = delete;
  NamePattern& operator=(const NamePattern&) = delete;

  bool matches(const std::string& name) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

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
