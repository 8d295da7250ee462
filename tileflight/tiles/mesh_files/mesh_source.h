#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/core/imaging/textured_mesh.h"
#include "tileflight/tiles/tile_content/content.h"

namespace tileflight::mesh_files {

/// Options for reading a mesh file.
struct MeshSourceOptions {
  std::optional<tile_content::UpAxis> up;  ///< the file's up axis; default: z for OBJ and PLY, y for glTF
  double metres_per_unit = 1.0;
  bool textures = true;  ///< false: only material or vertex colours
  /// Leaves the JPEG textures of a .glb in the file, which must stay as it is (imaging::with_pixels decodes them): for
  /// a place of which few textures are used at a time.
  bool defer_textures = false;
};

/// Textured triangles of a mesh file.
struct MeshSource {
  std::vector<imaging::TexturedMesh> meshes;  ///< z up, metres, relative to the file's origin; one or more per material
  std::vector<std::string> copyrights;        ///< stated in the file
  std::vector<std::string> warnings;          ///< distinct
};

/// Reads .obj (with its .mtl and images beside it), .glb, .gltf or .ply, chosen by the file extension. Textures are
/// decoded; colours of vertices and materials, which are sRGB in these files, are converted to linear, as TexturedMesh
/// requires. Degenerate triangles are left out with a warning. Throws InputError (file, line or part, cause): missing
/// or broken files (including material libraries and textures), no triangle with an area, points without faces.
MeshSource read_mesh_source(const std::filesystem::path& file, const MeshSourceOptions& options);

}  // namespace tileflight::mesh_files
