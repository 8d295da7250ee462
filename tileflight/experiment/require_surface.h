#pragma once

#include <string>
#include <vector>

#include "tileflight/imaging/textured_mesh.h"

namespace tileflight::experiment {

/// Throws InputError naming the source when there is no triangle that a camera could see; `has_points`: there are
/// points instead.
void require_surface(const std::vector<imaging::TexturedMesh>& meshes, bool has_points, const std::string& source);

}  // namespace tileflight::experiment
