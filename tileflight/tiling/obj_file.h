#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "tileflight/tiling/indexed_faces.h"

namespace tileflight::tiling {

/// What an OBJ file says of surfaces.
struct ObjFile {
  IndexedFaces faces;                  ///< colours white where only some vertices have one
  std::vector<std::string> libraries;  ///< of each `mtllib`, the rest of its line
  std::int64_t faces_left_out = 0;     ///< of fewer than three corners
  std::int64_t uv_not_finite = 0;      ///< read as 0
};

/// Reads the text of a Wavefront OBJ: v (with colours, as MeshLab and ODM write them), vt, f (polygons of any number of
/// corners, negative indices), usemtl, mtllib; lines of either ending, continued ones too. Normals, groups, lines and
/// points carry no surface and are passed over. `name` stands in messages. Throws InputError (name, line, cause): a
/// number that is none or not finite, an index that leads nowhere.
ObjFile parse_obj(std::string_view text, const std::string& name);

}  // namespace tileflight::tiling
