#pragma once

#include <string>
#include <vector>

#include "tileflight/imaging/textured_mesh.h"

namespace tileflight::experiment {

/// Throws InputError naming the source when there is no triangle that a camera could see; `has_points`: there are
/// points instead.
void require_surface(const std::vector<imaging::TexturedMesh>& meshes, bool has_points, const std::string& source);

/// Where nothing is in view there is yet something to cast rays into: a triangle without area, which none meets.
std::vector<imaging::TexturedMesh> or_nothing(std::vector<imaging::TexturedMesh> meshes);

}  // namespace tileflight::experiment
