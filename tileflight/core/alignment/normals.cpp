#include "tileflight/core/alignment/normals.h"

#include <tbb/parallel_for.h>

#include <Eigen/Eigenvalues>

namespace tileflight::alignment {

using geometry::Mat3;
using geometry::Vec3;

Vec3 estimate_normal(const std::vector<Vec3>& points, const geometry::NearestIndex& index, const Vec3& place,
                     std::size_t neighbors) {
  const auto nearest = index.nearest_k(place, neighbors);
  if (nearest.size() < 3) return Vec3::Zero();
  Vec3 mean = Vec3::Zero();
  for (const auto& n : nearest) mean += points[n.index];
  mean /= static_cast<double>(nearest.size());
  Mat3 covariance = Mat3::Zero();
  for (const auto& n : nearest) {
    const Vec3 d = points[n.index] - mean;
    covariance += d * d.transpose();
  }
  const Eigen::SelfAdjointEigenSolver<Mat3> eigen(covariance);
  constexpr double kLine = 1e-9;  // second over largest eigenvalue
  if (!(eigen.eigenvalues()[1] > kLine * eigen.eigenvalues()[2])) return Vec3::Zero();
  return eigen.eigenvectors().col(0);
}

geometry::PointCloud with_normals(const geometry::PointCloud& cloud, std::size_t neighbors) {
  const geometry::NearestIndex index(cloud.positions);
  geometry::PointCloud result = cloud;
  result.normals.resize(cloud.size());
  tbb::parallel_for(std::size_t{0}, cloud.size(), [&](std::size_t i) {
    result.normals[i] = estimate_normal(cloud.positions, index, cloud.positions[i], neighbors).cast<float>();
  });
  return result;
}

}  // namespace tileflight::alignment
