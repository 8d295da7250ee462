#pragma once

#include <array>
#include <map>
#include <string>
#include <string_view>

namespace tileflight::tiling {

/// What an MTL file says of a material's colour.
struct MtlMaterial {
  std::array<float, 3> color{1.0F, 1.0F, 1.0F};  ///< Kd, as displayed, 0..1
  std::string texture;                           ///< map_Kd as it is written; empty: none
  bool clamp = false;                            ///< the texture ends at its edge; otherwise it repeats
  std::array<float, 2> scale{1.0F, 1.0F};        ///< of texture coordinates: uv' = offset + scale * uv
  std::array<float, 2> offset{0.0F, 0.0F};
};

/// Reads the text of a Wavefront MTL: newmtl, Kd, map_Kd with -clamp, -s, -o; everything else is passed over. File
/// names may hold blanks. `name` stands in messages. Throws InputError (name, line, cause).
std::map<std::string, MtlMaterial> parse_mtl(std::string_view text, const std::string& name);

}  // namespace tileflight::tiling
