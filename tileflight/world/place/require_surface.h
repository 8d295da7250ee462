#pragma once

#include <string>
#include <vector>

#include "tileflight/core/imaging/textured_mesh.h"

namespace tileflight::place {

/// Throws InputError that names the source if there is no triangle to see; `has_points`: there are points instead (the
/// message says so).
void require_surface(const std::vector<imaging::TexturedMesh>& meshes, bool has_points, const std::string& source);

/// If there are no meshes, returns a degenerate triangle, which no ray hits: ray casting needs a scene that is not
/// empty.
std::vector<imaging::TexturedMesh> with_placeholder(std::vector<imaging::TexturedMesh> meshes);

}  // namespace tileflight::place
