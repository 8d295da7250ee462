#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "tileflight/simplification/indexed_faces.h"

namespace tileflight::tiling {

/// Surface data of an OBJ file.
struct ObjFile {
  simplification::IndexedFaces faces;  ///< white colours for vertices without one, if others have one
  std::vector<std::string> libraries;  ///< for each `mtllib`, the rest of its line
  std::int64_t faces_left_out = 0;     ///< with fewer than three corners
  std::int64_t uv_not_finite = 0;      ///< read as 0
};

/// Parses a Wavefront OBJ: v (with colours, as written by MeshLab and ODM), vt, f (polygons of any number of corners,
/// negative indices), usemtl, mtllib; either line ending, and continued lines. Normals, groups, lines and points are
/// ignored. `name` is used in messages. Throws InputError (name, line, cause): an invalid or non-finite number, an
/// index out of range.
ObjFile parse_obj(std::string_view text, const std::string& name);

}  // namespace tileflight::tiling
