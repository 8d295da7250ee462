#pragma once

#include <array>
#include <map>
#include <string>
#include <string_view>

namespace tileflight::mesh_files {

/// Colour properties of a material in an MTL file.
struct MtlMaterial {
  std::array<float, 3> color{1.0F, 1.0F, 1.0F};  ///< Kd, sRGB, 0..1
  std::string texture;                           ///< map_Kd as written; empty: none
  bool clamp = false;                            ///< clamp to the texture's edge; otherwise it repeats
  std::array<float, 2> scale{1.0F, 1.0F};        ///< of texture coordinates: uv' = offset + scale * uv
  std::array<float, 2> offset{0.0F, 0.0F};
};

/// Parses a Wavefront MTL: newmtl, Kd, map_Kd with -clamp, -s, -o; everything else is ignored. File names may contain
/// blanks. `name` is used in messages. Throws InputError (name, line, cause).
std::map<std::string, MtlMaterial> parse_mtl(std::string_view text, const std::string& name);

}  // namespace tileflight::mesh_files
