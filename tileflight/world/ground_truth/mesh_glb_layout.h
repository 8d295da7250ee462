#pragma once

#include "tileflight/core/geometry/transform.h"

// What writing and reading a mesh.glb (mesh_glb.h) agree on.
namespace tileflight::ground_truth {

/// Key of a mesh's `extras` that stores its MeshOrigin: {content, first, view: buffer view of `triangles`}.
inline constexpr const char* kOriginKey = "tileflight_origin";

/// z-up to y-up: (x, y, z) becomes (x, z, -y).
inline geometry::Mat4 T_gltf_local() {
  geometry::Mat4 m = geometry::Mat4::Identity();
  m.row(1) = Eigen::RowVector4d(0, 0, 1, 0);
  m.row(2) = Eigen::RowVector4d(0, -1, 0, 0);
  return m;
}

}  // namespace tileflight::ground_truth
