#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "tileflight/tiles/mesh_files/indexed_faces.h"
#include "tileflight/tiles/mesh_files/mesh_source.h"
#include "tileflight/tiles/mesh_files/mesh_spill.h"

namespace tileflight::mesh_files {

/// Colour properties of a material in an MTL file.
struct MtlMaterial {
  std::array<float, 3> color{1.0F, 1.0F, 1.0F};  ///< Kd, sRGB, 0..1
  std::string texture;                           ///< map_Kd as written; empty: none
  bool clamp = false;                            ///< clamp to the texture's edge; otherwise it repeats
  std::array<float, 2> scale{1.0F, 1.0F};        ///< texture coordinates become offset + scale * uv
  std::array<float, 2> offset{0.0F, 0.0F};
  bool is_transparent = false;  ///< d or Tr states an opacity below 1, which is not shown
};

/// Parses a Wavefront MTL: newmtl, Kd, d, Tr, map_Kd with -clamp, -s, -o; everything else is ignored. File names may
/// contain blanks. `name` is used in messages. Throws InputError (name, line, cause).
std::map<std::string, MtlMaterial> parse_mtl(std::string_view text, const std::string& name);

/// Contents of an OBJ file besides its surface.
struct ObjNotes {
  std::vector<std::string> libraries;  ///< for each `mtllib`, the rest of its line
  std::int64_t faces_left_out = 0;     ///< faces with fewer than three corners
  std::int64_t uv_not_finite = 0;      ///< texture coordinates that are read as 0
};

/// Surface data of an OBJ file.
struct ObjFile {
  IndexedFaces faces;  ///< white colours for vertices without one, if others have one
  ObjNotes notes;
};

/// Parses a Wavefront OBJ: v (with colours, as written by MeshLab and ODM), vt, f (polygons of any number of corners,
/// negative indices), usemtl, mtllib; either line ending, and continued lines. Normals, groups, lines and points are
/// ignored. `name` is used in messages. Throws InputError (name, line, cause): an invalid or non-finite number, an
/// index out of range.
ObjFile parse_obj(std::string_view text, const std::string& name);

/// Reads the surfaces of an OBJ with its material libraries and textures, in the file's units and axes. A texture
/// replaces Kd, as exporters intend. Throws InputError, also for a missing library or texture.
MeshSource read_obj_meshes(const std::filesystem::path& file, bool textures);

/// Reads an OBJ like read_obj_meshes(), but writes surfaces and textures into `spill`, for a mesh that does not fit
/// into memory. Throws InputError.
void spill_obj_meshes(const std::filesystem::path& file, bool textures, MeshSpill& spill);

/// Returns the image files that an OBJ refers to and that exist, without reading its surface.
std::vector<std::filesystem::path> obj_image_files(const std::filesystem::path& file);

}  // namespace tileflight::mesh_files
