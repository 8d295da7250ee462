#include "tileflight/evaluation/localization/ground_planes.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <random>

namespace tileflight::localization {

using geometry::Mat3;
using geometry::SE3;
using geometry::Vec3;

namespace {

struct Plane {
  Vec3 normal;
  double offset;  ///< n . p for points p on the plane

  double distance(const Vec3& p) const { return std::abs(normal.dot(p) - offset); }
};

double median_distance(const std::vector<Vec3>& points, const std::vector<SE3>& T_map_camera) {
  const Vec3 middle = T_map_camera[T_map_camera.size() / 2].translation;
  std::vector<double> distances;
  for (const Vec3& p : points) distances.push_back((p - middle).norm());
  std::ranges::nth_element(distances, distances.begin() + static_cast<std::ptrdiff_t>(distances.size() / 2));
  return distances[distances.size() / 2];
}

/// Orients the normal towards the cameras; false if they lie on both sides.
bool orient_to_cameras(Plane& plane, const std::vector<SE3>& T_map_camera) {
  std::size_t above = 0;
  for (const SE3& T : T_map_camera) above += plane.normal.dot(T.translation) > plane.offset ? 1 : 0;
  if (2 * above < T_map_camera.size()) {
    plane = {-plane.normal, -plane.offset};
    above = T_map_camera.size() - above;
  }
  return 10 * above >= 9 * T_map_camera.size();
}

Plane refit(const std::vector<Vec3>& points, const Plane& near, double tolerance) {
  Plane plane = near;
  for (int round = 0; round < 5; ++round) {
    Vec3 mean = Vec3::Zero();
    Mat3 moment = Mat3::Zero();
    double n = 0.0;
    for (const Vec3& p : points) {
      if (plane.distance(p) > tolerance) continue;
      mean += p, n += 1.0;
    }
    if (n < 3.0) return plane;
    mean /= n;
    for (const Vec3& p : points)
      if (plane.distance(p) <= tolerance) moment += (p - mean) * (p - mean).transpose();
    const Eigen::SelfAdjointEigenSolver<Mat3> eigen(moment);
    Vec3 normal = eigen.eigenvectors().col(0);
    if (normal.dot(plane.normal) < 0.0) normal = -normal;
    plane = {normal, normal.dot(mean)};
  }
  return plane;
}

}  // namespace

std::vector<GroundPlane> find_ground_planes(const std::vector<Vec3>& points, const std::vector<SE3>& T_map_camera,
                                            const GroundPlaneOptions& options) {
  std::vector<GroundPlane> planes;
  if (points.empty() || T_map_camera.empty()) return planes;
  constexpr std::size_t kSome = 3000, kFewest = 50;
  std::vector<Vec3> left;
  const std::size_t stride = std::max<std::size_t>(1, points.size() / kSome);
  for (std::size_t i = 0; i < points.size(); i += stride) left.push_back(points[i]);
  const double tolerance = options.tolerance * median_distance(left, T_map_camera);
  const auto all = static_cast<double>(left.size());
  std::mt19937_64 random(options.seed);
  while (planes.size() < options.max_planes && left.size() >= kFewest) {
    std::size_t most = 0;
    Plane best{};
    for (int k = 0; k < options.samples; ++k) {
      const Vec3& a = left[random() % left.size()];
      const Vec3& b = left[random() % left.size()];
      const Vec3& c = left[random() % left.size()];
      const Vec3 normal = (b - a).cross(c - a);
      if (!(normal.norm() > 1e-6 * (b - a).norm() * (c - a).norm())) continue;
      Plane plane{normal.normalized(), normal.normalized().dot(a)};
      if (!orient_to_cameras(plane, T_map_camera)) continue;
      std::size_t on = 0;
      for (const Vec3& p : left) on += plane.distance(p) <= tolerance ? 1 : 0;
      if (on > most) most = on, best = plane;
    }
    if (most < kFewest) break;
    best = refit(left, best, tolerance);
    std::vector<Vec3> others;
    for (const Vec3& p : left)
      if (best.distance(p) > tolerance) others.push_back(p);
    planes.push_back({best.normal, static_cast<double>(left.size() - others.size()) / all});
    left = std::move(others);
  }
  return planes;
}

}  // namespace tileflight::localization
