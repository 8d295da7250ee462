#include "tileflight/tiles/tile_content/content_transform.h"

#include <Eigen/LU>
#include <utility>

namespace tileflight::tile_content {

using geometry::Mat3;
using geometry::Mat4;
using geometry::Vec3;

void transform_mesh(const Mat4& T_target_source, imaging::TexturedMesh& mesh) {
  const Mat3 linear = T_target_source.topLeftCorner<3, 3>();
  const Vec3 translation = T_target_source.topRightCorner<3, 1>();
  for (Vec3& vertex : mesh.mesh.vertices) vertex = (linear * vertex + translation).eval();
  if (linear.determinant() >= 0) return;
  for (geometry::Triangle& triangle : mesh.mesh.triangles) std::swap(triangle[1], triangle[2]);
}

void transform_cloud(const Mat4& T_target_source, geometry::PointCloud& cloud) {
  const Mat3 linear = T_target_source.topLeftCorner<3, 3>();
  const Vec3 translation = T_target_source.topRightCorner<3, 1>();
  for (Vec3& point : cloud.positions) point = (linear * point + translation).eval();
  // The cofactor matrix is the inverse transpose times the determinant, and also exists for singular transforms.
  const double side = linear.determinant() < 0 ? -1.0 : 1.0;
  Mat3 of_normals;
  for (int i = 0; i < 3; ++i) of_normals.col(i) = linear.col((i + 1) % 3).cross(linear.col((i + 2) % 3));
  for (Eigen::Vector3f& normal : cloud.normals) {
    normal = (side * (of_normals * normal.cast<double>())).normalized().cast<float>();
  }
}

}  // namespace tileflight::tile_content
