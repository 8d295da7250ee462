#pragma once

#include "tileflight/geometry/point_cloud.h"
#include "tileflight/imaging/textured_mesh.h"

namespace tileflight::tiles {

/// Moves a mesh by an affine transform; one that mirrors turns the winding round (glTF 2.0, section 3.7.4).
void place_mesh(const geometry::Mat4& T_target_source, imaging::TexturedMesh& mesh);

/// Moves points by an affine transform, and their normals as those of a surface.
void place_cloud(const geometry::Mat4& T_target_source, geometry::PointCloud& cloud);

}  // namespace tileflight::tiles
