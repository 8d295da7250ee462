#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>

#include "tileflight/tiles/tileset/implicit_tiling.h"

namespace tileflight::tileset::test_support {

/// A tiling of a box of 16 m x 16 m x 8 m.
inline ImplicitTiling box_tiling(bool octree, std::uint32_t subtree_levels = 2, std::uint32_t available_levels = 4) {
  ImplicitTiling tiling;
  tiling.octree = octree;
  tiling.subtree_levels = subtree_levels;
  tiling.available_levels = available_levels;
  tiling.subtree_template = octree ? "s/{level}.{x}.{y}.{z}.subtree" : "s/{level}.{x}.{y}.subtree";
  tiling.content_templates = {"a/{level}.{x}.{y}.glb"};
  OrientedBox box;
  box.half_axes = geometry::Vec3(8, 8, 4).asDiagonal();
  tiling.root_volume = box;
  tiling.root_geometric_error_m = 16;
  return tiling;
}

/// Two levels of a quadtree, bits in Morton order: the root, its children (1, 0) and (0, 1), and of the sixteen child
/// subtrees the one at (3, 1) and the one at (1, 2).
inline nlohmann::json two_levels() {
  return {
      {"buffers", {{{"byteLength", 16}}}},
      {"bufferViews",
       {{{"buffer", 0}, {"byteOffset", 0}, {"byteLength", 1}}, {{"buffer", 0}, {"byteOffset", 8}, {"byteLength", 2}}}},
      {"tileAvailability", {{"bitstream", 0}, {"availableCount", 3}}},
      {"contentAvailability", {{{"constant", 1}}}},
      {"childSubtreeAvailability", {{"bitstream", 1}}}};
}

inline std::string two_levels_binary() {
  std::string binary(16, '\0');
  binary[0] = 0b01101;  // root, child 1 (x), child 2 (y)
  // Child subtrees in Morton order of two levels: (3, 1) is 0b0111 = 7, (1, 2) is 0b1001 = 9.
  binary[8] = static_cast<char>(1 << 7);
  binary[9] = 1 << 1;
  return binary;
}

}  // namespace tileflight::tileset::test_support
