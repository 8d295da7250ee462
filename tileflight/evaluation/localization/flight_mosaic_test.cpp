#include "tileflight/evaluation/localization/flight_mosaic.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cmath>

#include "tileflight/capture/render/appearance.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/evaluation/localization/orthophoto.h"
#include "tileflight/evaluation/localization/test_places.h"

namespace tileflight::localization::flight_mosaic_test {
namespace {

using geometry::Box3;
using geometry::Mat3;
using geometry::Vec2;
using geometry::Vec3;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

/// Correlation of the mosaic's grey values with the orthophoto's at the same positions.
double correlation_with(const GroundImage& truth, const GroundImage& mosaic) {
  double n = 0, sa = 0, sb = 0, aa = 0, bb = 0, ab = 0;
  for (int y = 0; y < mosaic.grey.height; y += 2) {
    for (int x = 0; x < mosaic.grey.width; x += 2) {
      if (mosaic.seen(x, y) == 0) continue;
      const Vec2 at = truth.to_pixel(mosaic.position(x, y));
      const int i = static_cast<int>(std::lround(at.x())), j = static_cast<int>(std::lround(at.y()));
      if (i < 0 || j < 0 || i >= truth.grey.width || j >= truth.grey.height) continue;
      const double a = mosaic.grey(x, y), b = truth.grey(i, j);
      n += 1, sa += a, sb += b, aa += a * a, bb += b * b, ab += a * b;
    }
  }
  return (n * ab - sa * sb) / std::sqrt((n * aa - sa * sa) * (n * bb - sb * sb));
}

double share_seen(const GroundImage& image) {
  double seen = 0.0;
  for (const auto value : image.seen.pixels) seen += value != 0 ? 1.0 : 0.0;
  return seen / static_cast<double>(image.seen.pixels.size());
}

TEST(FlightMosaic, FromAboveItIsTheOrthophoto) {
  const test_places::Hills place(1);
  const test_places::Flight flight(place, 0.0);
  const GroundImage mosaic = build_flight_mosaic(flight.pictures(), flight.points, Mat3::Identity());
  const GroundImage truth =
      build_orthophoto(place.scene, std::make_shared<const render::Appearance>(place.scene), place.scene.bounds());
  EXPECT_GT(correlation_with(truth, mosaic), 0.9);
  EXPECT_GT(share_seen(mosaic), 0.6);  // the rest is outside the area along the path
}

TEST(FlightMosaic, ALeaningCameraSeesTheSameGround) {
  const test_places::Hills place(1);
  const test_places::Flight flight(place, 0.7);
  const GroundImage mosaic = build_flight_mosaic(flight.pictures(), flight.points, Mat3::Identity());
  const GroundImage truth =
      build_orthophoto(place.scene, std::make_shared<const render::Appearance>(place.scene), place.scene.bounds());
  EXPECT_GT(correlation_with(truth, mosaic), 0.8);
}

TEST(FlightMosaic, HeightsAreThePoints) {
  const test_places::Hills place(1);
  const test_places::Flight flight(place, 0.3);
  const GroundImage mosaic = build_flight_mosaic(flight.pictures(), flight.points, Mat3::Identity());
  double squares = 0.0, n = 0.0;
  for (std::size_t k = 0; k < flight.points.size(); k += 5) {
    const auto height = mosaic.height_at(flight.points[k].head<2>());
    if (!height) continue;
    squares += std::pow(*height - flight.points[k].z(), 2), n += 1.0;
  }
  EXPECT_GT(n, 100.0);
  EXPECT_LT(std::sqrt(squares / n), 0.5);
}

TEST(FlightMosaic, NothingToShowIsEmpty) {
  const test_places::Hills place(1);
  const test_places::Flight flight(place, 0.0);
  EXPECT_TRUE(build_flight_mosaic(flight.pictures(), {}, Mat3::Identity()).grey.empty());
  FlightPictures none = flight.pictures();
  none.T_map_camera.clear();
  EXPECT_TRUE(build_flight_mosaic(none, flight.points, Mat3::Identity()).grey.empty());
  // With up inverted, no image sees the ground from above.
  const Mat3 over = Eigen::AngleAxisd(M_PI, Vec3::UnitX()).toRotationMatrix();
  EXPECT_TRUE(build_flight_mosaic(flight.pictures(), flight.points, over).grey.empty());
}

TEST(FlightMosaic, APictureOfAnotherSizeIsAnError) {
  const test_places::Hills place(1);
  const test_places::Flight flight(place, 0.0);
  FlightPictures pictures = flight.pictures();
  pictures.picture = [](std::size_t) { return imaging::RgbImage(20, 10); };
  EXPECT_THAT([&] { build_flight_mosaic(pictures, flight.points, Mat3::Identity()); },
              ThrowsMessage<InputError>(HasSubstr("is 20x10, the calibration is for")));
}

TEST(FlightMosaic, APictureThatCannotBeDecodedLeavesItsBlocksEmpty) {
  const test_places::Hills place(1);
  const test_places::Flight flight(place, 0.0);
  FlightPictures pictures = flight.pictures();
  const auto count = [&] {
    const GroundImage mosaic = build_flight_mosaic(pictures, flight.points, Mat3::Identity());
    return std::ranges::count(mosaic.seen.pixels, 255);
  };
  const auto all = count();
  const auto decode = pictures.picture;
  pictures.picture = [&](std::size_t k) { return k == 0 ? std::nullopt : decode(k); };
  EXPECT_LE(count(), all);
  pictures.picture = [](std::size_t) { return std::nullopt; };
  EXPECT_EQ(count(), 0);
  EXPECT_GT(all, 0);
}

TEST(FlightMosaic, ThreadsDoNotMatter) {
  const test_places::Hills place(1);
  const test_places::Flight flight(place, 0.4);
  const auto run = [&](std::size_t threads) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    return build_flight_mosaic(flight.pictures(), flight.points, Mat3::Identity());
  };
  const GroundImage one = run(1), four = run(4);
  EXPECT_EQ(one.grey.pixels, four.grey.pixels);
  EXPECT_EQ(one.seen.pixels, four.seen.pixels);
}

}  // namespace
}  // namespace tileflight::localization::flight_mosaic_test

namespace tileflight::localization::height_model_test {
namespace {

using geometry::Vec2;
using geometry::Vec3;

/// `side` x `side` points over the unit square, heights by a function.
template <typename Height>
std::vector<Vec3> points_over_square(int side, const Height& height) {
  std::vector<Vec3> points;
  for (int j = 0; j < side; ++j) {
    for (int i = 0; i < side; ++i) {
      const double x = (i + 0.5) / side, y = (j + 0.5) / side;
      points.emplace_back(x, y, height(x, y));
    }
  }
  return points;
}

TEST(HeightModel, IsThePlaneThatThePointsLieOn) {
  const auto plane = [](double x, double y) { return 2.0 + 0.3 * x - 0.2 * y; };
  const HeightModel model(points_over_square(60, plane), Vec2(0, 0), Vec2(1, 1));
  for (const Vec2& p : {Vec2(0.5, 0.5), Vec2(0.2, 0.7), Vec2(0.83, 0.11)}) {
    EXPECT_NEAR(model.at(p), plane(p.x(), p.y()), 0.3 * model.cell());
    EXPECT_TRUE(model.is_supported(p));
  }
  EXPECT_FALSE(model.is_supported(Vec2(1.2, 0.5)));
}

TEST(HeightModel, OutliersDoNotMoveIt) {
  std::vector<Vec3> points = points_over_square(60, [](double, double) { return 1.0; });
  for (std::size_t k = 0; k < points.size(); k += 7) points[k].z() = 50.0;
  const HeightModel model(points, Vec2(0, 0), Vec2(1, 1));
  for (const Vec2& p : {Vec2(0.5, 0.5), Vec2(0.2, 0.7), Vec2(0.83, 0.11)}) EXPECT_NEAR(model.at(p), 1.0, 1e-6);
}

TEST(HeightModel, AHoleIsFilledFromAroundAndNotSupported) {
  std::vector<Vec3> points = points_over_square(80, [](double x, double) { return x < 0.5 ? 1.0 : 2.0; });
  std::erase_if(points, [](const Vec3& p) { return (p.head<2>() - Vec2(0.25, 0.5)).norm() < 0.2; });
  const HeightModel model(points, Vec2(0, 0), Vec2(1, 1));
  EXPECT_NEAR(model.at(Vec2(0.25, 0.5)), 1.0, 0.5);
  EXPECT_FALSE(model.is_supported(Vec2(0.25, 0.5)));
  EXPECT_NEAR(model.at(Vec2(0.9, 0.5)), 2.0, 1e-6);
}

TEST(HeightModel, WithoutPointsItIsLevelAndSupportedNowhere) {
  const HeightModel model({}, Vec2(0, 0), Vec2(1, 1));
  EXPECT_EQ(model.at(Vec2(0.5, 0.5)), 0.0);
  EXPECT_FALSE(model.is_supported(Vec2(0.5, 0.5)));
  const HeightModel one({Vec3(0.3, 0.3, 4.0)}, Vec2(0, 0), Vec2(1, 1));
  EXPECT_EQ(one.at(Vec2(0.9, 0.9)), 4.0);
}

}  // namespace
}  // namespace tileflight::localization::height_model_test
