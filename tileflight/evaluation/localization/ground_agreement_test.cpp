#include "tileflight/evaluation/localization/ground_agreement.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "tileflight/evaluation/localization/test_places.h"

namespace tileflight::localization::ground_agreement_test {
namespace {

using geometry::Sim3;
using geometry::Vec2;
using geometry::Vec3;

constexpr double kHeight = 3.0;

/// Level ground with a noise texture: pixel p shows the point T_local_image of its position. A texture cell is 0.1 m.
GroundImage ground_image(int size, double pixel, const Vec2& first, const Sim3& T_local_image, int seed) {
  GroundImage image;
  image.grey = imaging::GrayImage(size, size);
  image.seen = imaging::GrayImage(size, size, 255);
  image.pixel_size = pixel;
  image.origin = first;
  const int heights = (size + GroundImage::kHeightStep - 1) / GroundImage::kHeightStep;
  image.height =
      imaging::FloatImage(heights, heights, static_cast<float>((T_local_image.inverse() * Vec3(0, 0, kHeight)).z()));
  for (int y = 0; y < size; ++y) {
    for (int x = 0; x < size; ++x) {
      const Vec2 at = image.position(x, y);
      const Vec3 p = T_local_image * Vec3(at.x(), at.y(), 0.0);
      image.grey(x, y) = static_cast<std::uint8_t>(test_places::blotches_at(10.0 * p.x(), 10.0 * p.y(), seed));
    }
  }
  return image;
}

GroundImage place() { return ground_image(600, 0.1, Vec2(-30.0, 30.0), Sim3(), 1); }

/// The mosaic's unit is 5 m.
Sim3 truth() { return {5.0, Eigen::Quaterniond(Eigen::AngleAxisd(0.8, Vec3::UnitZ())), Vec3(3.0, -4.0, 0.5)}; }

GroundImage mosaic_of(int seed) { return ground_image(240, 0.02, Vec2(-2.4, 2.4), truth(), seed); }

TEST(GroundAgreement, FindsThePlaceFromHalfAMetreOff) {
  const GroundImage ground = place(), mosaic = mosaic_of(1);
  Sim3 off = truth();
  off.scale *= 1.02;
  off.rotation = Eigen::Quaterniond(Eigen::AngleAxisd(0.02, Vec3::UnitZ())) * off.rotation;
  off.translation += Vec3(0.4, -0.3, 0.0);
  const GroundAgreement found = compute_ground_agreement(GroundPyramid(mosaic), GroundPyramid(ground), off);
  for (const Vec3& p : {Vec3(-2, -2, 0.5), Vec3(2, -2, 0.5), Vec3(0, 2, 0.5)})
    EXPECT_LT((found.T_local_mosaic * p - truth() * p).head<2>().norm(), 0.08);
  EXPECT_GT(found.correlation, 0.9);
  EXPECT_GT(found.height_agreement, 0.9);
  EXPECT_GT(found.overlap, 0.95);
}

TEST(GroundAgreement, AnotherPlaceAndAnotherHeightDoNotAgree) {
  const GroundImage ground = place(), mosaic = mosaic_of(1), other = mosaic_of(77);
  EXPECT_LT(compute_ground_agreement(GroundPyramid(other), GroundPyramid(ground), truth()).correlation, 0.4);
  Sim3 higher = truth();
  higher.translation.z() += 5.0;
  EXPECT_LT(compute_ground_agreement(GroundPyramid(mosaic), GroundPyramid(ground), higher).height_agreement, 0.1);
  Sim3 beside = truth();
  beside.translation.x() += 200.0;
  EXPECT_EQ(compute_ground_agreement(GroundPyramid(mosaic), GroundPyramid(ground), beside).correlation, 0.0);
}

TEST(GroundAgreement, ThePyramidHoldsMeans) {
  GroundImage image = place();
  const GroundPyramid pyramid(image);
  double sum = 0.0;
  for (int k = 0; k < 4; ++k) sum += image.grey(100 + k % 2, 200 + k / 2);
  EXPECT_NEAR(pyramid.at(image.position(100.5, 200.5), 0.2), sum / 4.0, 1.0);
  EXPECT_EQ(pyramid.at(image.position(100, 200), 0.1), static_cast<float>(image.grey(100, 200)));
  EXPECT_TRUE(std::isnan(pyramid.at(Vec2(500.0, 0.0), 0.1)));
}

}  // namespace
}  // namespace tileflight::localization::ground_agreement_test

namespace tileflight::localization::ground_fit_test {
namespace {

using geometry::Sim3;
using geometry::Vec2;
using geometry::Vec3;

double hills_m(double x, double y) { return 3.0 * std::sin(0.2 * x) + 2.0 * std::cos(0.25 * y); }

/// 60 m of hills, heights every 0.4 m.
GroundImage hilly_ground() {
  GroundImage image;
  image.pixel_size = 0.1;
  image.origin = Vec2(-30.0, 30.0);
  image.height = imaging::FloatImage(150, 150);
  for (int j = 0; j < 150; ++j) {
    for (int i = 0; i < 150; ++i) {
      const Vec2 p = image.position(GroundImage::kHeightStep * i, GroundImage::kHeightStep * j);
      image.height(i, j) = static_cast<float>(hills_m(p.x(), p.y()));
    }
  }
  return image;
}

/// The mosaic's up direction is tilted by a few degrees; its unit is 4 m.
Sim3 truth() {
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(0.7, Vec3::UnitZ()));
  const Eigen::Quaterniond lean(Eigen::AngleAxisd(0.06, Vec3(0.6, 0.8, 0.0)));
  return {4.0, turn * lean, Vec3(2.0, -3.0, 1.5)};
}

struct Scattered {
  std::vector<GroundPair> pairs;
  std::vector<Vec3> surface;

  explicit Scattered(int wrong) {
    std::mt19937_64 random(4);
    std::uniform_real_distribution<double> unit(-12.0, 12.0);
    for (int k = 0; k < 200; ++k) {
      const double x = unit(random), y = unit(random);
      const Vec3 p(x, y, hills_m(x, y));
      surface.push_back(truth().inverse() * p);
      if (k < 20) pairs.push_back({surface.back(), p, 1.0});
    }
    for (int k = 0; k < wrong; ++k) {
      const double x = unit(random), y = unit(random);
      pairs.push_back({surface[30 + k], Vec3(x, y, hills_m(x, y)), 1.0});
    }
  }
};

/// Slightly wrong and without the tilt, like a similarity in the plane.
Sim3 start() { return {4.1, Eigen::Quaterniond(Eigen::AngleAxisd(0.73, Vec3::UnitZ())), Vec3(2.4, -3.3, 2.0)}; }

double worst_m(const Sim3& T, const std::vector<Vec3>& points) {
  double worst = 0.0;
  for (const Vec3& p : points) worst = std::max(worst, (T * p - truth() * p).norm());
  return worst;
}

TEST(GroundFit, FindsTheLeanTheScaleAndTheHeight) {
  const Scattered exact(0), mistaken(8);
  const GroundImage ground = hilly_ground();
  EXPECT_GT(worst_m(start(), exact.surface), 1.0);
  EXPECT_LT(worst_m(fit_to_ground(start(), exact.pairs, exact.surface, ground), exact.surface), 0.15);
  EXPECT_LT(worst_m(fit_to_ground(start(), mistaken.pairs, mistaken.surface, ground), exact.surface), 0.15);
}

TEST(GroundFit, WithoutPairsOrSurfaceItIsTheStart) {
  const Scattered exact(0);
  const GroundImage ground = hilly_ground();
  EXPECT_EQ(fit_to_ground(start(), {}, exact.surface, ground).matrix(), start().matrix());
  EXPECT_EQ(fit_to_ground(start(), exact.pairs, {}, ground).matrix(), start().matrix());
}

TEST(GroundFit, TheSurfaceIsEveryHeightThatIsKnown) {
  GroundImage mosaic = hilly_ground();
  mosaic.height(3, 2) = std::nanf("");
  EXPECT_EQ(sample_heights(mosaic, 1000000).size(), 150U * 150U - 1U);
  const std::vector<Vec3> some = sample_heights(mosaic, 1000);
  EXPECT_NEAR(static_cast<double>(some.size()), 1000.0, 60.0);
  for (const Vec3& p : some) EXPECT_NEAR(p.z(), hills_m(p.x(), p.y()), 1e-5);
}

}  // namespace
}  // namespace tileflight::localization::ground_fit_test
