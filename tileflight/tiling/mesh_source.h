#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/imaging/textured_mesh.h"
#include "tileflight/tiles/tileset.h"

namespace tileflight::tiling {

struct MeshSourceOptions {
  std::optional<tiles::UpAxis> up;  ///< the file's axis that points up; default: z of OBJ and PLY, y of glTF
  double metres_per_unit = 1.0;
  bool textures = true;  ///< false: surfaces have their material's or vertices' colours only
};

/// A mesh file as textured triangles.
struct MeshSource {
  std::vector<imaging::TexturedMesh> meshes;  ///< z up, metres, in the file's own origin; one or more a material
  std::vector<std::string> copyrights;        ///< that the file states
  std::vector<std::string> warnings;          ///< distinct
};

/// Reads .obj (with its .mtl and pictures beside it), .glb, .gltf or .ply by the file's ending. Textures are decoded;
/// colours of vertices and materials, which these files give as displayed, become linear as TexturedMesh has them.
/// Triangles without area are left out and warned of. Throws InputError (file, line or part, cause): missing or broken
/// files (a material library or a texture among them), no triangle that has an area, points without surface.
MeshSource read_mesh_source(const std::filesystem::path& file, const MeshSourceOptions& options);

}  // namespace tileflight::tiling
