#include "tileflight/tiles/tileset/bounding_volume.h"

#include <gtest/gtest.h>

#include <array>
#include <numbers>
#include <random>

#include "tileflight/core/geometry/geodesy.h"

namespace tileflight::tileset::bounding_volume_test {
namespace {

using geometry::Box3;
using geometry::Mat3;
using geometry::Mat4;
using geometry::SE3;
using geometry::Vec3;

/// Clips a convex polygon by the half-space sign * p[axis] <= sign * limit (Sutherland and Hodgman).
std::vector<Vec3> clipped(const std::vector<Vec3>& polygon, int axis, double sign, double limit) {
  std::vector<Vec3> out;
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Vec3& a = polygon[i];
    const Vec3& b = polygon[(i + 1) % polygon.size()];
    const double da = sign * (limit - a[axis]);
    const double db = sign * (limit - b[axis]);
    if (da >= 0) out.push_back(a);
    if ((da > 0 && db < 0) || (da < 0 && db > 0)) out.push_back(a + (b - a) * (da / (da - db)));
  }
  return out;
}

/// Alternative method: some face of the parallelepiped intersects the box, or one body contains the other.
bool meets_by_clipping(const OrientedBox& a, const Box3& box) {
  for (int axis = 0; axis < 3; ++axis) {
    for (const double side : {-1.0, 1.0}) {
      const Vec3 middle = a.center + side * a.half_axes.col(axis);
      const Vec3 u = a.half_axes.col((axis + 1) % 3);
      const Vec3 v = a.half_axes.col((axis + 2) % 3);
      std::vector<Vec3> face = {middle - u - v, middle + u - v, middle + u + v, middle - u + v};
      for (int k = 0; k < 3; ++k) {
        face = clipped(face, k, 1, box.max()[k]);
        face = clipped(face, k, -1, box.min()[k]);
      }
      if (!face.empty()) return true;
    }
  }
  const Vec3 inside = a.half_axes.inverse() * (box.center() - a.center);
  return inside.cwiseAbs().maxCoeff() <= 1;
}

class Random {
 public:
  double in(double low, double high) { return std::uniform_real_distribution<double>(low, high)(engine_); }
  Vec3 vector(double reach) { return {in(-reach, reach), in(-reach, reach), in(-reach, reach)}; }
  SE3 motion(double reach) { return {Eigen::Quaterniond(in(-1, 1), in(-1, 1), in(-1, 1), in(-1, 1)), vector(reach)}; }

 private:
  std::mt19937 engine_{7};
};

TEST(BoundingVolume, BoxesMeetAsClippingSays) {
  Random random;
  const Box3 box(Vec3(-1, -2, -0.5), Vec3(1, 1, 0.7));
  int met = 0;
  for (int i = 0; i < 8000; ++i) {
    OrientedBox a{random.vector(4), Mat3::Zero()};
    for (int k = 0; k < 3; ++k) a.half_axes.col(k) = random.vector(1.5);  // sheared and left-handed ones too
    const SE3 T_local_tileset = random.motion(3);
    OrientedBox local{T_local_tileset * a.center, T_local_tileset.rotation.toRotationMatrix() * a.half_axes};
    const bool wanted = meets_by_clipping(local, box);
    ASSERT_EQ(intersects(a, T_local_tileset, box), wanted) << i;
    met += wanted ? 1 : 0;
  }
  EXPECT_GT(met, 800);
  EXPECT_LT(met, 7200);
}

TEST(BoundingVolume, FlatBoxesLinesAndPoints) {
  const Box3 box(Vec3(0, 0, 0), Vec3(1, 1, 1));
  OrientedBox flat{Vec3(2, 2, 0.5), Mat3::Zero()};
  EXPECT_FALSE(intersects(flat, SE3(), box));
  flat.half_axes.col(0) = Vec3(1, -1, 0);  // passes the corner (1, 1) at a distance of 1 / sqrt 2
  EXPECT_FALSE(intersects(flat, SE3(), box));
  flat.center = Vec3(1, 1, 0.5);
  EXPECT_TRUE(intersects(flat, SE3(), box));
  flat.half_axes.col(1) = Vec3(1, 1, 0);
  flat.center = Vec3(1.9, 1.9, 0.5);
  EXPECT_TRUE(intersects(flat, SE3(), box));
  flat.center = Vec3(2.1, 2.1, 0.5);
  EXPECT_FALSE(intersects(flat, SE3(), box));
}

TEST(BoundingVolume, TouchingCounts) {
  const Box3 box(Vec3(0, 0, 0), Vec3(1, 1, 1));
  const OrientedBox beside{Vec3(2, 0.5, 0.5), Mat3::Identity()};
  EXPECT_TRUE(intersects(beside, SE3(), box));
  EXPECT_TRUE(intersects(BoundingSphere{Vec3(3, 0.5, 0.5), 2.0}, SE3(), box));
  EXPECT_FALSE(intersects(BoundingSphere{Vec3(3, 0.5, 0.5), 1.99}, SE3(), box));
}

TEST(BoundingVolume, TransformsHoldWhatTheyHeld) {
  Random random;
  for (int i = 0; i < 2000; ++i) {
    Mat4 T = Mat4::Identity();
    for (int k = 0; k < 3; ++k) T.block<3, 1>(0, k) = random.vector(2);
    T.topRightCorner<3, 1>() = random.vector(10);
    OrientedBox box{random.vector(1), Mat3::Identity()};
    const Vec3 in_box = box.center + box.half_axes * random.vector(1);
    const auto moved_box = std::get<OrientedBox>(transformed(T, box));
    const Vec3 moved = (T * in_box.homogeneous()).head<3>();
    EXPECT_LE((moved_box.half_axes.inverse() * (moved - moved_box.center)).cwiseAbs().maxCoeff(), 1 + 1e-6);

    const BoundingSphere sphere{random.vector(1), 0.8};
    const Vec3 in_sphere = sphere.center + 0.8 * random.vector(1).normalized();
    const auto moved_sphere = std::get<BoundingSphere>(transformed(T, sphere));
    const double distance = ((T * in_sphere.homogeneous()).head<3>() - moved_sphere.center).norm();
    EXPECT_LE(distance, moved_sphere.radius_m + 1e-9);
  }
}

TEST(BoundingVolume, GeographicRegionsHoldAllTheirPoints) {
  Random random;
  constexpr double kDegrees = 180 / std::numbers::pi;
  for (int i = 0; i < 300; ++i) {
    const double reach = std::pow(10.0, random.in(-6, 0));  // from metres to continents
    GeographicRegion region;
    region.south_rad = random.in(-1.5, 1.5 - reach);
    region.north_rad = std::min(region.south_rad + reach, std::numbers::pi / 2);
    region.west_rad = random.in(-3.1, 3.1);
    region.east_rad = region.west_rad + reach;
    if (region.east_rad > std::numbers::pi) region.east_rad -= 2 * std::numbers::pi;  // over the antimeridian
    region.min_height_m = random.in(-100, 100);
    region.max_height_m = region.min_height_m + random.in(0, 3000);
    const geometry::LocalFrame frame({random.in(-90, 90), random.in(-180, 180), {0}});
    const Box3 box = local_bounding_box(region, frame.T_local_ecef());
    for (int j = 0; j < 100; ++j) {
      const double latitude = random.in(region.south_rad, region.north_rad) * kDegrees;
      const double longitude = (region.west_rad + random.in(0, reach)) * kDegrees;
      const Vec3 point =
          frame.local_from_geodetic({latitude, longitude, {random.in(region.min_height_m, region.max_height_m)}});
      ASSERT_LE(box.exteriorDistance(point), 1e-6) << i;
    }
    if (reach < 1e-3) {
      EXPECT_LT((local_bounding_box(
                     region, geometry::LocalFrame(geometry::geodetic_from_ecef(center_of(region))).T_local_ecef())
                     .sizes()
                     .head<2>()
                     .maxCoeff()),
                1.2 * reach * 6.4e6 + 1);
    }
  }
}

/// A cap at a pole: its middle is the pole, and its bounds are not those of half the earth.
TEST(BoundingVolume, CapAtAPole) {
  constexpr double kQuarter = std::numbers::pi / 2;
  for (const double side : {1.0, -1.0}) {
    GeographicRegion cap{};
    cap.west_rad = -std::numbers::pi;
    cap.east_rad = std::numbers::pi;
    cap.south_rad = side > 0 ? 1.5 : -kQuarter;
    cap.north_rad = side > 0 ? kQuarter : -1.5;
    cap.max_height_m = 100.0;
    const geometry::Geodetic middle = geometry::geodetic_from_ecef(center_of(cap));
    EXPECT_NEAR(middle.latitude_deg, 90.0 * side, 1e-9);
    EXPECT_NEAR(middle.height.m, 50.0, 1e-6);
    const geometry::Box3 box = local_bounding_box(cap, geometry::LocalFrame(middle).T_local_ecef());
    EXPECT_NEAR(box.sizes().x(), 906e3, 10e3);
    EXPECT_GT(box.min().z(), -20e3) << "16 km below the tangent plane at its rim";
    EXPECT_LT(box.max().z(), 5e3);
  }
}

constexpr double kDegree = std::numbers::pi / 180.0;

/// All points within the margin of a volume's points lie in the widened one, and none far beyond.
TEST(Widened, HoldsAllPointsWithinTheMargin) {
  Random random;
  const Vec3 somewhere = geometry::ecef_from_geodetic({47.0, 8.0, {400.0}});
  const auto inside = [](const BoundingVolume& volume, const Vec3& p) { return intersects(volume, SE3(), Box3(p, p)); };
  for (int i = 0; i < 300; ++i) {
    const double margin_m = random.in(0.1, 50.0);
    OrientedBox box;
    box.center = random.vector(100);
    for (int axis = 0; axis < 3; ++axis) box.half_axes.col(axis) = random.vector(20);
    if (i % 3 == 1) box.half_axes.col(i % 2).setZero();
    if (i % 30 == 2) box.half_axes.setZero();
    const Vec3 own = box.center + box.half_axes * random.vector(1.0);
    const Vec3 near = own + random.vector(1.0).normalized() * margin_m * 0.999;
    EXPECT_TRUE(inside(widened(box, margin_m), near)) << i;
    const BoundingSphere sphere{random.vector(100), random.in(0, 30)};
    const auto larger = std::get<BoundingSphere>(widened(sphere, margin_m));
    EXPECT_EQ(larger.center, sphere.center);
    EXPECT_EQ(larger.radius_m, sphere.radius_m + margin_m);
    const GeographicRegion region{8 * kDegree, 47 * kDegree, 8.001 * kDegree, 47.001 * kDegree, 390, 410};
    EXPECT_TRUE(inside(widened(region, margin_m), somewhere + random.vector(1.0).normalized() * margin_m * 0.999));
  }
  OrientedBox cube;
  cube.half_axes = 3.0 * Mat3::Identity();
  EXPECT_TRUE(std::get<OrientedBox>(widened(cube, 2.0)).half_axes.isApprox(5.0 * Mat3::Identity()));
  const auto across = std::get<GeographicRegion>(
      widened(GeographicRegion{179.9999 * kDegree, 0, 179.99999 * kDegree, 0.001 * kDegree, 0, 1}, 100.0));
  EXPECT_GT(across.west_rad, 0);
  EXPECT_LT(across.east_rad, 0) << "over the antimeridian";
}

}  // namespace
}  // namespace tileflight::tileset::bounding_volume_test
