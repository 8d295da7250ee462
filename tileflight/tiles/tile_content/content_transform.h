#pragma once

#include "tileflight/core/geometry/point_cloud.h"
#include "tileflight/core/imaging/textured_mesh.h"

namespace tileflight::tile_content {

/// Applies an affine transform to a mesh; a reflection reverses the winding (glTF 2.0, section 3.7.4).
void transform_mesh(const geometry::Mat4& T_target_source, imaging::TexturedMesh& mesh);

/// Applies an affine transform to points, and to their normals as surface normals.
void transform_cloud(const geometry::Mat4& T_target_source, geometry::PointCloud& cloud);

}  // namespace tileflight::tile_content
