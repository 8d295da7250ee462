#include "tileflight/core/imaging/camera.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

#include "tests/test_data.h"
#include "tileflight/core/base/input_error.h"

namespace tileflight::imaging::camera_test {
namespace {

using geometry::Vec2;
using geometry::Vec3;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;
using Jacobian = Eigen::Matrix<double, 2, 3>;
constexpr double kPi = std::numbers::pi;

// Series of r = 2 sin(theta / 2), the equisolid lens.
constexpr std::array<double, 4> kEquisolid{-1.0 / 24, 1.0 / 1920, -1.0 / 322560, 1.0 / 92897280};

struct Lens {
  const char* name;
  Camera camera;
  bool sees_whole_image = true;
};

std::vector<Lens> lenses() {
  return {
      {"pinhole", make_pinhole(640, 480, 90.0)},
      {"radtan of EuRoC",
       {PinholeRadtan{458.654, 457.296, 367.215, 248.375, {-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05}}, 752,
        480}},
      {"radtan with strong tangential part", {PinholeRadtan{500, 510, 330, 235, {0.1, -0.02, 0.01, -0.008}}, 640, 480}},
      {"radial only", {PinholeRadtan{458.654, 457.296, 367.215, 248.375, {-0.28340811, 0.07395907, 0, 0}}, 752, 480}},
      {"fov", {FovModel{0.535719308086809 * 640, 0.669566858850269 * 480, 315, 238, 0.897966326944875}, 640, 480}},
      {"fov without bend", {FovModel{400, 410, 315, 238, 0.0}, 640, 480}},
      {"kannala-brandt of TUM VI",
       {KannalaBrandt{
            190.97847715, 190.97330798, 254.93170605, 256.89744203, {0.00348238, 0.00071503, -0.00205323, 0.00020293}},
        512, 512}},
      {"equisolid of 155 degrees", make_fisheye(1008, 566, 155.0, kEquisolid)},
      {"equidistant of 155 degrees", make_fisheye(2688, 1512, 155.0)},
      {"equisolid of 200 degrees", make_fisheye(1000, 500, 200.0, kEquisolid)},
      {"equidistant of 300 degrees", make_fisheye(1000, 300, 300.0)},
      {"double sphere", {DoubleSphere{158, 158.5, 254, 256.5, -0.18, 0.59}, 512, 512}},
      {"double sphere beyond 180 degrees", {DoubleSphere{230, 230, 399.5, 149.5, 0.4, 0.62}, 800, 300}},
      {"unified", {UnifiedModel{900, 905, 370, 245, 1.6, {-0.3, 0.05, 0.001, -0.002}}, 752, 480}},
      {"unified without distortion, beyond 180 degrees", {UnifiedModel{300, 300, 399.5, 199.5, 1.0, {}}, 800, 400}},
      {"unified without a sphere",
       {UnifiedModel{458.654, 457.296, 367.215, 248.375, 0, {-0.28, 0.07, 0.0002, 2e-5}}, 752, 480}},
      {"extended unified", {ExtendedUnifiedModel{190, 191, 254, 256.5, 0.63, 1.05}, 512, 512}},
      {"rational of a wide lens",
       {PinholeRational{570, 572, 640.5, 362.25, {8.1, 3.2, 2e-4, -3e-4, 0.14, 8.4, 5.6, 0.78, 0, 0, 0, 0}}, 1280,
        720}},
      {"rational, radial only", {PinholeRational{500, 500, 320, 240, {-0.3, 0.12, 0, 0, -0.03}}, 640, 480}},
      {"thin prism",
       {PinholeRational{700, 710, 630, 350, {0.2, -0.1, 1e-3, -2e-3, 0.05, 0.3, -0.05, 0.01, 2e-3, -1e-3, 1e-3, 5e-4}},
        1280, 720}},
      {"panorama without its poles and seam", {Equirectangular{100, 101, 299.5, 139.5}, 600, 280}},
      {"extended unified beyond 180 degrees", {ExtendedUnifiedModel{300, 300, 399.5, 99.5, 0.7, 1.3}, 800, 200}},
  };
}

TEST(Camera, ProjectUndoesUnprojectOverTheWholeImage) {
  for (const Lens& lens : lenses()) {
    const Camera& camera = lens.camera;
    double worst = 0.0;
    for (double y = -0.5; y <= camera.height() - 0.5; y += 5.0)
      for (double x = -0.5; x <= camera.width() - 0.5; x += 5.0) {
        const auto ray = camera.unproject({x, y});
        ASSERT_TRUE(ray.has_value()) << lens.name << " at " << x << " " << y;
        ASSERT_NEAR(ray->norm(), 1.0, 1e-14);
        const auto pixel = camera.project(*ray);
        ASSERT_TRUE(pixel.has_value()) << lens.name << " at " << x << " " << y;
        worst = std::max(worst, (*pixel - Vec2(x, y)).norm());
      }
    EXPECT_LT(worst, 1e-9) << lens.name;
  }
}

TEST(Camera, UnprojectUndoesProjectOverTheCone) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  for (const Lens& lens : lenses()) {
    const bool flat = std::holds_alternative<PinholeRadtan>(lens.camera.model()) ||
                      std::holds_alternative<PinholeRational>(lens.camera.model()) ||
                      std::holds_alternative<FovModel>(lens.camera.model());
    for (int i = 0; i < 2000; ++i) {
      // Near the edge of the cone the inverse is ill-conditioned, so tests stay slightly inside it.
      const double theta = 0.98 * uniform(random) * std::min(lens.camera.max_theta_rad(), flat ? 1.0 : kPi);
      const double azimuth = 2.0 * kPi * uniform(random);
      const Vec3 ray(std::sin(theta) * std::cos(azimuth), std::sin(theta) * std::sin(azimuth), std::cos(theta));
      const auto pixel = lens.camera.project(37.0 * ray);
      if (!pixel) continue;  // a tangential part may fold earlier than the radial one
      const auto back = lens.camera.unproject(*pixel);
      ASSERT_TRUE(back.has_value()) << lens.name;
      EXPECT_LT((*back - ray).norm(), 1e-10) << lens.name << " at " << theta;
    }
  }
}

/// Central differences with Richardson's step.
Jacobian numeric_jacobian(const Camera& camera, const Vec3& p) {
  Jacobian j;
  for (int i = 0; i < 3; ++i) {
    const double h = 1e-4 * p.norm();
    const auto slope = [&](double step) -> Vec2 {
      return (*camera.project(p + step * Vec3::Unit(i)) - *camera.project(p - step * Vec3::Unit(i))) / (2.0 * step);
    };
    j.col(i) = (4.0 * slope(h) - slope(2.0 * h)) / 3.0;
  }
  return j;
}

TEST(Camera, JacobianMatchesDifferences) {
  for (const Lens& lens : lenses()) {
    const Camera& camera = lens.camera;
    for (double y = 3.0; y < camera.height(); y += 37.0)
      for (double x = 3.0; x < camera.width(); x += 37.0) {
        const Vec3 p = 12.5 * *camera.unproject({x, y});
        Jacobian analytic;
        const auto pixel = camera.project(p, analytic);
        ASSERT_TRUE(pixel.has_value());
        EXPECT_EQ(*pixel, *camera.project(p));
        const Jacobian numeric = numeric_jacobian(camera, p);
        EXPECT_LT((analytic - numeric).norm(), 1e-6 * std::max(1.0, numeric.norm()))
            << lens.name << " at " << x << " " << y;
      }
  }
}

TEST(Camera, JacobianOnTheAxisIsTheLimit) {
  for (const Lens& lens : lenses()) {
    Jacobian on_axis;
    Jacobian beside;
    ASSERT_TRUE(lens.camera.project({0, 0, 4}, on_axis).has_value());
    ASSERT_TRUE(lens.camera.project({1e-9, -1e-9, 4}, beside).has_value());
    EXPECT_LT((on_axis - beside).norm(), 1e-5) << lens.name;
    EXPECT_TRUE(on_axis.allFinite());
  }
}

TEST(Camera, KnownValues) {
  const Camera pinhole(PinholeRadtan{500, 400, 320, 240, {}}, 640, 480);
  EXPECT_EQ(*pinhole.project({1, -2, 10}), Vec2(370, 160));
  // Equidistant: r = f theta exactly.
  const Camera fisheye(KannalaBrandt{100, 100, 200, 200, {}}, 401, 401);
  EXPECT_NEAR(fisheye.project({1, 0, 1})->x(), 200 + 100 * kPi / 4, 1e-12);
  EXPECT_NEAR(fisheye.project({0, -1, 0})->y(), 200 - 100 * kPi / 2, 1e-12);
  EXPECT_NEAR(fisheye.project({1, 0, -1})->x(), 200 + 100 * 3 * kPi / 4, 1e-12);
  // By hand: x = 0.1, y = 0.2, r2 = 0.05, radial = 1 + 0.1 * 0.05 + 0.2 * 0.0025 = 1.0055.
  const Camera radtan(PinholeRadtan{1000, 1000, 0, 0, {0.1, 0.2, 0.01, 0.02}}, 100, 100);
  const Vec2 pixel = *radtan.project({0.1, 0.2, 1});
  EXPECT_NEAR(pixel.x(), 1000 * (0.10055 + 2 * 0.01 * 0.02 + 0.02 * (0.05 + 0.02)), 1e-9);
  EXPECT_NEAR(pixel.y(), 1000 * (0.2011 + 0.01 * (0.05 + 0.08) + 2 * 0.02 * 0.02), 1e-9);
  // Field of view: at the angle whose tangent is 1 / (2 tan(w/2)), r = atan(1) / w.
  const Camera fov(FovModel{100, 100, 0, 0, 0.9}, 100, 100);
  EXPECT_NEAR(fov.project({1.0 / (2 * std::tan(0.45)), 0, 1})->x(), 100 * (kPi / 4) / 0.9, 1e-10);
}

TEST(Camera, ValidCone) {
  const Camera pinhole = make_pinhole(100, 100, 60);
  EXPECT_FALSE(pinhole.project({0, 0, 0}).has_value());
  EXPECT_FALSE(pinhole.project({1, 1, 0}).has_value());
  EXPECT_FALSE(pinhole.project({0, 0, -1}).has_value());
  const double nan = std::nan("");
  EXPECT_FALSE(pinhole.project({nan, 0, nan}).has_value());

  const Camera fisheye = make_fisheye(100, 100, 220);
  EXPECT_TRUE(fisheye.project({1, 0, -2}).has_value());
  EXPECT_FALSE(fisheye.project({0, 0, -1}).has_value());  // no direction in the image
  EXPECT_FALSE(fisheye.project({0, 0, 0}).has_value());
  EXPECT_FALSE(fisheye.project({nan, 0, 1}).has_value());
  EXPECT_DOUBLE_EQ(fisheye.max_theta_rad(), kPi);
}

TEST(Camera, ConeEndsWhereTheRadiusStopsGrowing) {
  // r = theta - theta^3 / 3: slope 1 - theta^2, so the cone ends at 1 rad, with r = 2/3.
  const Camera camera(KannalaBrandt{300, 300, 200, 200, {-1.0 / 3, 0, 0, 0}}, 401, 401);
  EXPECT_NEAR(camera.max_theta_rad(), 1.0, 1e-12);
  EXPECT_TRUE(camera.project({std::sin(0.999), 0, std::cos(0.999)}).has_value());
  EXPECT_FALSE(camera.project({std::sin(1.001), 0, std::cos(1.001)}).has_value());
  EXPECT_TRUE(camera.unproject({200 + 300 * 0.6666, 200}).has_value());
  EXPECT_FALSE(camera.unproject({200 + 300 * 0.6667, 200}).has_value());

  // r (1 - r^2 / 3) of radtan: the cone ends at r = 1, 45 degrees.
  const Camera radtan(PinholeRadtan{300, 300, 200, 200, {-1.0 / 3, 0, 0, 0}}, 401, 401);
  EXPECT_NEAR(radtan.max_theta_rad(), kPi / 4, 1e-12);
  EXPECT_FALSE(radtan.project({1.001, 0, 1}).has_value());
  EXPECT_FALSE(radtan.unproject({200 + 300 * 0.6667, 200}).has_value());
}

TEST(Camera, HorizontalFieldOfView) {
  EXPECT_NEAR(make_pinhole(640, 480, 90).horizontal_fov_deg(), 90, 1e-9);
  EXPECT_NEAR(make_fisheye(2688, 1512, 155, kEquisolid).horizontal_fov_deg(), 155, 1e-9);
  EXPECT_NEAR(make_fisheye(640, 480, 250).horizontal_fov_deg(), 250, 1e-9);
  // An image larger than the lens's image circle: limited by the lens.
  const Camera camera(KannalaBrandt{100, 100, 499.5, 499.5, {-1.0 / 3, 0, 0, 0}}, 1000, 1000);
  EXPECT_NEAR(camera.horizontal_fov_deg(), 2.0 * 180 / kPi, 1e-3);
}

TEST(Camera, ScaledToSeesTheSameDirections) {
  for (const Lens& lens : lenses()) {
    const Camera half = lens.camera.scaled_to(lens.camera.width() / 2, lens.camera.height() / 2);
    // The corner of the image stays the corner of the image: -0.5 maps to -0.5.
    const Vec3 corner = *lens.camera.unproject({-0.5, -0.5});
    EXPECT_LT((*half.project(corner) - Vec2(-0.5, -0.5)).norm(), 1e-9) << lens.name;
    const Vec3 ray = *lens.camera.unproject({100.5, 60.5});
    EXPECT_LT((*half.project(ray) - Vec2(50, 30)).norm(), 1e-9) << lens.name;
  }
  EXPECT_NO_THROW(make_pinhole(1008, 566, 90).scaled_to(2688, 1512));  // 16:9 within a pixel
  EXPECT_THAT([&] { make_pinhole(640, 480, 90).scaled_to(640, 360); },
              ThrowsMessage<InputError>(HasSubstr("640x480 to 640x360: the aspect ratio differs")));
  EXPECT_THAT([&] { make_pinhole(640, 480, 90).scaled_to(0, 0); },
              ThrowsMessage<InputError>(HasSubstr("cannot be scaled from 640x480 to 0x0")));
}

Vec3 direction(double theta, double azimuth) {
  return {std::sin(theta) * std::cos(azimuth), std::sin(theta) * std::sin(azimuth), std::cos(theta)};
}

TEST(Camera, DoubleSphereIsTwoSpheresAndAPinhole) {
  // The construction of the paper's figure, step by step: projection onto the unit sphere, onto a second one shifted by
  // xi, then a pinhole shifted by alpha / (1 - alpha), whose focal length is 1 / (1 - alpha).
  const double xi = -0.18, alpha = 0.59, f = 158;
  const Camera camera(DoubleSphere{f, f, 250, 240, xi, alpha}, 512, 512);
  for (double theta = 0.0; theta < camera.max_theta_rad(); theta += 0.05) {
    const Vec3 on_second = (direction(theta, 0.7) + xi * Vec3::UnitZ()).normalized();
    const Vec3 shifted = on_second + alpha / (1.0 - alpha) * Vec3::UnitZ();
    const Vec2 expected = f / (1.0 - alpha) * shifted.head<2>() / shifted.z() + Vec2(250, 240);
    EXPECT_LT((*camera.project(42.0 * direction(theta, 0.7)) - expected).norm(), 1e-10 * expected.norm()) << theta;
  }
}

TEST(Camera, SphereLensesSeeBehindThemselves) {
  for (const Lens& lens : lenses()) {
    if (std::string(lens.name).find("beyond 180 degrees") == std::string::npos) continue;
    EXPECT_GT(lens.camera.horizontal_fov_deg(), 190.0) << lens.name;
    EXPECT_TRUE(lens.camera.project(direction(1.7, 0.3))) << lens.name;
  }
}

TEST(Camera, SphereLensesAgreeWhereTheyAreTheSameLens) {
  const double alpha = 0.62, f = 300;
  const Camera extended(ExtendedUnifiedModel{f, f, 320, 240, alpha, 1.0}, 640, 480);
  const Camera sphere(DoubleSphere{f, f, 320, 240, 0.0, alpha}, 640, 480);
  const Camera unified(UnifiedModel{f / (1 - alpha), f / (1 - alpha), 320, 240, alpha / (1 - alpha), {}}, 640, 480);
  const std::array<double, 4> d{-0.28, 0.07, 0.0002, 2e-5};
  const Camera flat(PinholeRadtan{458, 457, 367, 248, d}, 752, 480);
  const Camera no_sphere(UnifiedModel{458, 457, 367, 248, 0.0, d}, 752, 480);
  EXPECT_NEAR(sphere.max_theta_rad(), extended.max_theta_rad(), 1e-7);
  EXPECT_NEAR(unified.max_theta_rad(), extended.max_theta_rad(), 1e-7);
  EXPECT_NEAR(no_sphere.max_theta_rad(), flat.max_theta_rad(), 1e-12);
  for (double theta = 0.0; theta < 2.0; theta += 0.05) {
    const Vec3 ray = direction(theta, 2.0);
    EXPECT_LT((*sphere.project(ray) - *extended.project(ray)).norm(), 1e-9);
    EXPECT_LT((*unified.project(ray) - *extended.project(ray)).norm(), 1e-9);
    ASSERT_EQ(no_sphere.project(ray).has_value(), flat.project(ray).has_value());
    if (flat.project(ray)) {
      EXPECT_LT((*no_sphere.project(ray) - *flat.project(ray)).norm(), 1e-12 * flat.project(ray)->norm() + 1e-9);
    }
  }
}

/// Largest angle up to which the pixel moves outwards, found in small steps of a formula for the radius by angle that
/// reports where it is undefined.
template <class RadiusOf>
double walked_cone(const RadiusOf& radius) {
  constexpr double kStep = 1e-4;
  double last = 0.0;
  for (double theta = kStep; theta < kPi; theta += kStep) {
    const double r = radius(theta);
    if (!(r > last)) return theta;
    last = r;
  }
  return kPi;
}

TEST(Camera, ConesOfSphereLensesEndWhereTheRadiusStopsGrowing) {
  for (const double xi : {-0.6, -0.2, 0.0, 0.3, 1.0, 1.5, 2.5})
    for (const double alpha : {0.0, 0.2, 0.5, 0.55, 0.7, 1.0}) {
      const Camera camera(DoubleSphere{100, 100, 50, 50, xi, alpha}, 101, 101);
      const double walked = walked_cone([&](double t) {
        const double z = xi + std::cos(t);
        const double below = alpha * std::hypot(std::sin(t), z) + (1 - alpha) * z;
        return below > 0 ? std::sin(t) / below : -1.0;
      });
      EXPECT_NEAR(camera.max_theta_rad(), walked, 1e-3) << xi << " " << alpha;
    }
  for (const double xi : {0.0, 0.4, 1.0, 2.0})
    for (const double k1 : {-0.1, 0.0, 0.1}) {
      const Camera camera(UnifiedModel{100, 100, 50, 50, xi, {k1, 0, 0, 0}}, 101, 101);
      const double walked = walked_cone([&](double t) {
        const double r = std::sin(t) / (xi + std::cos(t));
        return r * (1 + k1 * r * r);
      });
      EXPECT_NEAR(camera.max_theta_rad(), walked, 1e-3) << xi << " " << k1;
    }
  for (const double alpha : {0.0, 0.4, 0.5, 0.8})
    for (const double beta : {0.5, 1.0, 2.0}) {
      const Camera camera(ExtendedUnifiedModel{100, 100, 50, 50, alpha, beta}, 101, 101);
      const double walked = walked_cone([&](double t) {
        const double s = std::sin(t), c = std::cos(t);
        const double below = alpha * std::sqrt(beta * s * s + c * c) + (1 - alpha) * c;
        return below > 0 ? s / below : -1.0;
      });
      EXPECT_NEAR(camera.max_theta_rad(), walked, 1e-3) << alpha << " " << beta;
    }
}

TEST(Camera, RationalWithoutADenominatorIsRadtan) {
  const Camera radtan(PinholeRadtan{458, 457, 367, 248, {-0.28, 0.07, 2e-4, 2e-5}}, 752, 480);
  const Camera rational(PinholeRational{458, 457, 367, 248, {-0.28, 0.07, 2e-4, 2e-5}}, 752, 480);
  EXPECT_NEAR(rational.max_theta_rad(), radtan.max_theta_rad(), 2e-6);  // it ends at a radius of 1e6
  for (double y = 0; y < 480; y += 31)
    for (double x = 0; x < 752; x += 31)
      EXPECT_LT((*rational.unproject({x, y}) - *radtan.unproject({x, y})).norm(), 1e-13) << x << " " << y;
}

TEST(Camera, RationalByHand) {
  // x = 0.5, y = 0.25: r2 = 0.3125, r4 = 0.09765625, r6 = 0.030517578125.
  const Camera camera(PinholeRational{1000, 1000, 0, 0, {0.1, 0.2, 0.01, 0.02, 0.3, 0.4, 0.5, 0.6, 0.1, 0.2, 0.3, 0.4}},
                      100, 100);
  const double ratio = (1 + 0.1 * 0.3125 + 0.2 * 0.09765625 + 0.3 * 0.030517578125) /
                       (1 + 0.4 * 0.3125 + 0.5 * 0.09765625 + 0.6 * 0.030517578125);
  const double x = 0.5 * ratio + 2 * 0.01 * 0.125 + 0.02 * (0.3125 + 0.5) + 0.1 * 0.3125 + 0.2 * 0.09765625;
  const double y = 0.25 * ratio + 0.01 * (0.3125 + 0.125) + 2 * 0.02 * 0.125 + 0.3 * 0.3125 + 0.4 * 0.09765625;
  EXPECT_LT((*camera.project({1, 0.5, 2}) - Vec2(1000 * x, 1000 * y)).norm(), 1e-10);
}

TEST(Camera, ConesOfRationalLensesEndWhereTheRadiusStopsGrowing) {
  for (const std::array<double, 6>& k : {std::array<double, 6>{-0.3, 0, 0, 0, 0, 0},
                                         {0, 0, 0, 0.5, 0, 0},
                                         {0.2, -0.1, 0, 0, 0.3, 0.4},
                                         {0, 0, 0, -0.4, 0, 0},
                                         {-0.2, 0.3, -0.4, 0.1, 0.0, 0.0},
                                         {1.0, 1.0, 1.0, 1.0, 1.0, 1.0}}) {
    const Camera camera(PinholeRational{100, 100, 50, 50, {k[0], k[1], 0, 0, k[2], k[3], k[4], k[5]}}, 101, 101);
    const double walked = walked_cone([&](double t) {
      const double r = std::tan(t), r2 = r * r;
      const double below = 1 + r2 * (k[3] + r2 * (k[4] + r2 * k[5]));
      return t < kPi / 2 && below > 0 ? r * (1 + r2 * (k[0] + r2 * (k[1] + r2 * k[2]))) / below : -1.0;
    });
    EXPECT_NEAR(camera.max_theta_rad(), walked, 2e-4) << k[0] << " " << k[3];
  }
}

TEST(Camera, PanoramaShowsTheWholeSphere) {
  const Camera camera = make_panorama(720, 360);  // two pixels a degree
  EXPECT_NEAR(camera.horizontal_fov_deg(), 360.0, 1e-9);
  EXPECT_NEAR(camera.max_image_angle_rad(), kPi, 1e-7);
  const Vec2 middle(359.5, 179.5);
  EXPECT_LT((*camera.project({0, 0, 3}) - middle).norm(), 1e-12);
  EXPECT_LT((*camera.project({2, 0, 0}) - middle - Vec2(180, 0)).norm(), 1e-12);
  EXPECT_LT((*camera.project({-1, 0, 1}) - middle - Vec2(-90, 0)).norm(), 1e-12);
  EXPECT_LT((*camera.project({0, 1, 1}) - middle - Vec2(0, 90)).norm(), 1e-12);
  EXPECT_NEAR(camera.project({0, -1, 0})->y(), -0.5, 1e-12);
  EXPECT_NEAR(std::abs(camera.project({0, 0, -1})->x() - middle.x()), 360, 1e-12);
  Jacobian none;
  EXPECT_FALSE(camera.project({0, 1, 0}, none).has_value());
  EXPECT_FALSE(camera.project({0, 0, 0}).has_value());
  EXPECT_FALSE(camera.project({std::nan(""), 0, 1}).has_value());
  EXPECT_FALSE(camera.unproject({720.0, 100.0}).has_value());
  EXPECT_FALSE(camera.unproject({100.0, 360.0}).has_value());
  for (int y = 0; y < 360; y += 7)
    for (int x = 0; x < 720; x += 7) {
      const Vec3 ray = *camera.unproject({static_cast<double>(x), static_cast<double>(y)});
      EXPECT_LT((*camera.project(5.0 * ray) - Vec2(x, y)).norm(), 1e-9);
    }
}

TEST(Camera, WidestAngleIsThatOfTheBorder) {
  EXPECT_NEAR(make_pinhole(100, 100, 90).max_image_angle_rad(), std::atan(std::sqrt(2.0)), 1e-9);
  EXPECT_NEAR(make_fisheye(400, 100, 200).max_image_angle_rad(), std::hypot(1.0, 0.25) * 100 * kPi / 180, 1e-9);
}

TEST(Camera, ImpossibleFieldsOfViewAreRefused) {
  EXPECT_THAT([&] { make_pinhole(640, 480, 180); },
              ThrowsMessage<InputError>(HasSubstr("a pinhole: above 0 and below 180")));
  EXPECT_THAT([&] { make_pinhole(640, 480, 0); },
              ThrowsMessage<InputError>(HasSubstr("a pinhole: above 0 and below 180")));
  EXPECT_THAT(
      [&] {
        make_fisheye(640, 480, 150, {-1.0 / 3, 0, 0, 0});
      },
      ThrowsMessage<InputError>(HasSubstr("outside the range of this fisheye lens")));
  EXPECT_THAT([&] { make_fisheye(640, 480, std::nan("")); },
              ThrowsMessage<InputError>(HasSubstr("outside the range of this fisheye lens")));
}

TEST(Camera, MachangaraIsTheEquisolidLensItSaysItIs) {
  TILEFLIGHT_REQUIRE_TEST_DATA(file, "flights/machangara-a/camera.yaml");
  const Camera camera = read_kalibr(file).camera;
  EXPECT_EQ(camera.width(), 1008);
  EXPECT_EQ(camera.height(), 566);
  EXPECT_NEAR(camera.horizontal_fov_deg(), 155.0, 0.05);
  const double f = 402.605129;
  double worst = 0.0;
  for (int y = 0; y < 566; y += 5)
    for (int x = 0; x < 1008; x += 5) {
      const Vec3 ray = *camera.unproject({static_cast<double>(x), static_cast<double>(y)});
      const double r = 2.0 * f * std::sin(0.5 * std::acos(ray.z()));  // equisolid, closed form
      const double azimuth = std::atan2(ray.y(), ray.x());
      worst = std::max(worst, std::hypot(503.5 + r * std::cos(azimuth) - x, 283.0 + r * std::sin(azimuth) - y));
    }
  EXPECT_LT(worst, 0.1);
}

}  // namespace
}  // namespace tileflight::imaging::camera_test
