#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "tileflight/tiles/mesh_files/indexed_faces.h"

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

/// Contents of an OBJ file besides its surface.
struct ObjNotes {
  std::vector<std::string> libraries;  ///< for each `mtllib`, the rest of its line
  std::int64_t faces_left_out = 0;     ///< faces with fewer than three corners
  std::int64_t uv_not_finite = 0;      ///< texture coordinates that are read as 0
};

/// Reads an OBJ like parse_obj(), and hands its surface over instead of keeping it. `between` is called from time to
/// time, between two lines.
ObjNotes visit_obj(std::string_view text, const std::string& name, FaceReceiver& faces,
                   const std::function<void()>& between = {});

/// Surface data of an OBJ file.
struct ObjFile {
  IndexedFaces faces;  ///< white colours for vertices without one, if others have one
  ObjNotes notes;
};

/// Returns the factor that brings vertex colours into 0..1. In a file where one exceeds 1 they are out of 255.
float obj_color_scale(float highest);

/// Parses a Wavefront OBJ: v (with colours, as written by MeshLab and ODM), vt, f (polygons of any number of corners,
/// negative indices), usemtl, mtllib; either line ending, and continued lines. Normals, groups, lines and points are
/// ignored. `name` is used in messages. Throws InputError (name, line, cause): an invalid or non-finite number, an
/// index out of range.
ObjFile parse_obj(std::string_view text, const std::string& name);

}  // namespace tileflight::mesh_files
