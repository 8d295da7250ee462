#include "tileflight/core/geometry/point_cloud.h"

#include <cassert>
#include <utility>

namespace tileflight::geometry {
namespace {

template <typename T>
std::vector<T> kept(const std::vector<T>& values, const std::vector<bool>& keep) {
  std::vector<T> result;
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (keep[i]) result.push_back(values[i]);
  }
  return result;
}

}  // namespace

PointCloud transformed(const Sim3& T_target_source, PointCloud cloud) {
  PointCloud result = std::move(cloud);
  for (Vec3& p : result.positions) p = T_target_source * p;
  const Eigen::Matrix3f rotation = T_target_source.rotation.toRotationMatrix().cast<float>();
  for (Eigen::Vector3f& n : result.normals) n = (rotation * n).eval();
  return result;
}

PointCloud filter_points(const PointCloud& cloud, const std::vector<bool>& keep) {
  assert(keep.size() == cloud.size());
  PointCloud result{kept(cloud.positions, keep), kept(cloud.normals, keep), kept(cloud.colors, keep), {}};
  for (const auto& [name, values] : cloud.scalars) result.scalars[name] = kept(values, keep);
  return result;
}

}  // namespace tileflight::geometry
