#pragma once

// For the tests of registration: a place with buildings, a path over it, and a simulated odometry map.

#include <cmath>
#include <random>

#include "tests/height_field.h"
#include "tileflight/core/geometry/mesh.h"
#include "tileflight/core/geometry/triangle_index.h"
#include "tileflight/evaluation/registration/observed_points.h"
#include "tileflight/evaluation/registration/register_map.h"

namespace tileflight::registration::test_flights {

using geometry::SE3;
using geometry::Sim3;
using geometry::Vec3;

/// Hills with block-shaped buildings, metres.
inline double height_m(double x, double y) {
  double z = 4.0 * std::sin(0.06 * x) + 3.0 * std::cos(0.09 * y + 0.02 * x);
  for (const Vec3& b : {Vec3(20, 10, 9), Vec3(-30, 25, 6), Vec3(5, -35, 12), Vec3(-20, -20, 5), Vec3(38, -12, 7)}) {
    if (std::abs(x - b.x()) < 8.0 && std::abs(y - b.y()) < 6.0) z += b.z();
  }
  return z;
}

inline geometry::TriangleMesh ground_mesh() { return tests::height_field(120, -60.0, 120.0, height_m); }

/// The ground as registration takes it, with what a search needs.
struct Place {
  geometry::TriangleMesh mesh = ground_mesh();
  geometry::TriangleIndex index{mesh};
  GroundTruthSurface surface{index, mesh, {geometry::Box3(Vec3(-60, -60, -1e6), Vec3(60, 60, 1e6))}};
};

inline const Place& the_place() {
  static const Place place;
  return place;
}

/// Height of the place's triangle mesh, linear within each triangle, metres.
inline double surface_m(double x, double y) {
  const double i = std::floor(x), j = std::floor(y), u = x - i, v = y - j;
  const double b = height_m(i + 1, j), c = height_m(i, j + 1);
  if (u + v <= 1.0) {
    const double a = height_m(i, j);
    return a + u * (b - a) + v * (c - a);
  }
  const double d = height_m(i + 1, j + 1);
  return d + (1.0 - u) * (c - d) + (1.0 - v) * (b - d);
}

/// Distance to the place along a ray, by marching and bisection, independent of the code under test.
inline std::optional<double> cast_ray(const Vec3& origin, const Vec3& direction, double reach_m) {
  const auto below = [&](double t) {
    const Vec3 p = origin + t * direction;
    return std::abs(p.x()) < 60.0 && std::abs(p.y()) < 60.0 && p.z() < surface_m(p.x(), p.y());
  };
  constexpr double kStep_m = 0.1;
  for (double t = kStep_m; t < reach_m; t += kStep_m) {
    if (!below(t)) continue;
    double out = t - kStep_m, in = t;
    for (int k = 0; k < 30; ++k) (below(0.5 * (out + in)) ? in : out) = 0.5 * (out + in);
    return in;
  }
  return std::nullopt;
}

/// A camera at `position` that looks down along `down_deg` below the horizon, towards `heading_deg` from north.
inline SE3 camera_at(const Vec3& position, double heading_deg, double down_deg) {
  const double h = heading_deg * M_PI / 180.0, d = down_deg * M_PI / 180.0;
  const Vec3 forward(std::sin(h) * std::cos(d), std::cos(h) * std::cos(d), -std::sin(d));
  const Vec3 right(std::cos(h), -std::sin(h), 0.0);
  geometry::Mat3 axes;
  axes << right, forward.cross(right), forward;
  return {axes, position};
}

/// True transform from map to local frame.
inline Sim3 T_local_map() { return {8.0, geometry::so3_exp({2.0, 0.3, -0.5}), {10.0, -5.0, 40.0}}; }

struct Flight {
  geometry::Trajectory local;  ///< true poses, one per second
  geometry::Trajectory map;    ///< the same in the map's frame
  ObservedPoints points;       ///< map frame
};

/// Simulates a map: every pose hosts up to `per_pose` points scattered around its axis, with relative distance errors
/// of standard deviation `sigma`.
inline Flight simulate_map(const geometry::Trajectory& local, std::size_t per_pose = 150, double sigma = 0.005,
                           unsigned seed = 1) {
  Flight flight{.local = local};
  const Sim3 T_map_local = T_local_map().inverse();
  flight.map = geometry::transformed(T_map_local, local);
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  for (std::size_t k = 0; k < local.size(); ++k) {
    const SE3& pose = local.poses[k].T_local_camera;
    for (std::size_t i = 0; i < per_pose; ++i) {
      const Vec3 ray = pose.rotation * Vec3(0.4 * normal(random), 0.4 * normal(random), 1.0).normalized();
      const auto distance_m = cast_ray(pose.translation, ray, 200.0);
      if (!distance_m) continue;
      const Vec3 point = pose.translation + *distance_m * (1.0 + sigma * normal(random)) * ray;
      flight.points.positions.push_back(T_map_local * point);
      flight.points.viewpoints.push_back(T_map_local * pose.translation);
      flight.points.distance_sigma.push_back(sigma);
      flight.points.keyframe.push_back(k);
    }
  }
  return flight;
}

inline geometry::Trajectory straight_path() {
  geometry::Trajectory path;
  for (int k = 0; k < 20; ++k)
    path.poses.push_back({double(k), camera_at(Vec3(-25.0 + 2.5 * k, -20.0 + 1.6 * k, 35.0), 57.0, 55.0)});
  return path;
}

inline geometry::Trajectory curved_path() {
  geometry::Trajectory path;
  for (int k = 0; k < 24; ++k) {
    const double a = 0.2 * k;
    path.poses.push_back(
        {double(k), camera_at(Vec3(25.0 * std::cos(a), 22.0 * std::sin(a), 32.0 + 0.2 * k), 20.0 * k, 60.0)});
  }
  return path;
}

/// RMS distance between where two similarities put the points.
inline double rms_distance_m(const ObservedPoints& points, const Sim3& A, const Sim3& B) {
  double sum = 0.0;
  for (const Vec3& p : points.positions) sum += (A * p - B * p).squaredNorm();
  return std::sqrt(sum / static_cast<double>(points.size()));
}

}  // namespace tileflight::registration::test_flights
