#include "tileflight/live/simulator/sensor_cells.h"

#include <gmock/gmock.h>

#include <cmath>
#include <random>

#include "tileflight/tiles/tileset/bounding_volume.h"

namespace tileflight::simulator::sensor_cells_test {
namespace {

using geometry::Box3;
using geometry::Vec3;

double uniform(std::mt19937_64& random, double low, double high) {
  return low + (high - low) * static_cast<double>(random() >> 11) * 0x1p-53;
}

Vec3 uniform_in(std::mt19937_64& random, const Box3& box) {
  Vec3 p;
  for (int axis = 0; axis < 3; ++axis) p[axis] = uniform(random, box.min()[axis], box.max()[axis]);
  return p;
}

Box3 box_of(const SensorCell& cell) {
  const Vec3 center(cell.center[0], cell.center[1], cell.center[2]), half = Vec3::Constant(SensorCell::kSize_m / 2);
  return {center - half, center + half};
}

TEST(SensorCells, HoldTheirSensorsAndTheHighestResolution) {
  const std::vector<SensorViewpoint> viewpoints{
      {Vec3(1, 2, 3), 100.0}, {Vec3(-1, 2, 3), 50.0}, {Vec3(5, 5, 5), 200.0}, {Vec3(23.9, 0, 0), 10.0}};
  const SensorCells cells = cells_around(viewpoints);
  ASSERT_EQ(cells.size(), 2U);
  EXPECT_EQ(cells[0], (SensorCell{{-12, 12, 12}, 50.0}));
  EXPECT_EQ(cells[1], (SensorCell{{12, 12, 12}, 200.0}));
  EXPECT_EQ(cells_around(std::vector<SensorViewpoint>{viewpoints.rbegin(), viewpoints.rend()}), cells);
}

TEST(DetailLimits, GetCoarserFarAwayFirstAndEnd) {
  DetailLimit detail{2.0};
  EXPECT_EQ(detail.allowed_px(1e6), 2.0);
  int steps = 0;
  while (const auto coarser = detail.coarser()) {
    EXPECT_GE(coarser->allowed_px(100.0), detail.allowed_px(100.0));
    EXPECT_GT(coarser->allowed_px(5000.0), detail.allowed_px(5000.0));
    if (coarser->full_detail_m > 300.0) {
      EXPECT_EQ(coarser->allowed_px(300.0), 2.0);
    }
    detail = *coarser;
    ASSERT_LT(++steps, 100);
  }
  EXPECT_GT(detail.error_px, 2000.0);
  EXPECT_DOUBLE_EQ(detail.allowed_px(2.0 * detail.full_detail_m), 2.0 * detail.error_px);
}

/// Whether a straight line between two points (ECEF) meets the ellipsoid lowered by 500 m, by small steps.
bool crosses_the_earth(const Vec3& a, const Vec3& b) {
  constexpr int kSteps = 4000;
  for (int i = 0; i <= kSteps; ++i) {
    const Vec3 p = a + (b - a) * i / kSteps;
    if (geometry::geodetic_from_ecef(p).height.m < -500.0) return true;
  }
  return false;
}

TEST(Horizons, HideWhatIsBehindTheEarthAndNothingElse) {
  std::mt19937_64 random(1);
  int hidden = 0, behind = 0;
  for (int round = 0; round < 400; ++round) {
    const geometry::LocalFrame frame(
        {uniform(random, -80, 80), uniform(random, -180, 180), {uniform(random, 0, 3000)}});
    const Horizon horizon(frame);
    const Vec3 eye(0, 0, uniform(random, 1, 1000));
    const double away_m = std::pow(10.0, uniform(random, 4.0, 6.5)), turn = uniform(random, 0, 6.28);
    geometry::Geodetic place = frame.geodetic_from_local({away_m * std::cos(turn), away_m * std::sin(turn), 0});
    place.height.m = uniform(random, -400, 3000);
    const Vec3 point = frame.local_from_geodetic(place);
    const bool hides = horizon.hides(Box3(point, point), eye, 0.0);
    const bool crosses = crosses_the_earth(frame.T_ecef_local() * eye, frame.T_ecef_local() * point);
    if (hides) {
      EXPECT_TRUE(crosses) << "round " << round;
    }
    hidden += hides ? 1 : 0;
    behind += crosses ? 1 : 0;
    // A box or cell that reaches into sight is not hidden.
    if (!crosses) {
      EXPECT_FALSE(horizon.hides(Box3(point - Vec3::Constant(3e3), point + Vec3::Constant(1e3)), eye, 20.0));
    }
  }
  EXPECT_GT(hidden, 50);
  EXPECT_GT(hidden, behind * 9 / 10) << "the limit is close for points";
}

TEST(SensorCriteria, AllowNoErrorAboveTheLimitFromAnywhereInTheCells) {
  std::mt19937_64 random(2);
  int fine = 0, coarse = 0;
  for (int round = 0; round < 2000; ++round) {
    const DetailLimit detail{1.5, round % 2 == 0 ? std::numeric_limits<double>::infinity() : 300.0};
    SensorCells cells;
    for (int i = 0; i < 1 + round % 3; ++i) {
      SensorCell cell;
      for (double& x : cell.center) x = (std::floor(uniform(random, -5, 5)) + 0.5) * SensorCell::kSize_m;
      cell.pixels_per_rad = uniform(random, 50, 500);
      cells.push_back(cell);
    }
    const Box3 box(Vec3(uniform(random, -900, 900), uniform(random, -900, 900), 0),
                   Vec3(uniform(random, 900, 1000), uniform(random, 900, 1000), 30));
    const tileset::BoundingVolume volume =
        tileset::OrientedBox{box.center(), geometry::Mat3((box.sizes() / 2).asDiagonal())};
    const double error_m = std::pow(10.0, uniform(random, -2, 2));
    double worst_px = 0.0;
    const SensorCriterion wanted{geometry::SE3(), detail, 0.005};
    const bool enough = wanted.for_cells(cells, &worst_px).is_fine_enough(volume, error_m);
    (enough ? fine : coarse)++;
    if (!enough) continue;
    for (const SensorCell& cell : cells) {
      for (int i = 0; i < 20; ++i) {
        const Vec3 sensor = uniform_in(random, box_of(cell));
        const double distance_m = box.exteriorDistance(sensor);
        const double error_px = error_m * cell.pixels_per_rad / distance_m;
        EXPECT_LE(error_px, detail.allowed_px(distance_m) * (1 + 1e-9));
        EXPECT_LE(error_px, worst_px * (1 + 1e-9)) << "what is told is an upper limit";
      }
    }
  }
  EXPECT_GT(fine, 100);
  EXPECT_GT(coarse, 100);
}

TEST(SensorCriteria, LeaveOutWhatIsFartherThanTheViewingDistance) {
  const SensorCells cells{{{12, 12, 12}, 100.0}};
  const auto at = [](double east_m) {
    return tileset::BoundingVolume(tileset::BoundingSphere{Vec3(east_m, 12, 12), 10.0});
  };
  SensorCriterion wanted{geometry::SE3(), {1.0}};
  EXPECT_TRUE(wanted.for_cells(cells).intersects(at(1e7)));
  wanted.max_distance_m = 500.0;
  const tileset::RefinementCriterion near = wanted.for_cells(cells);
  EXPECT_TRUE(near.intersects(at(12 + 500 + 10 + 12 - 1))) << "seen from the cell's edge";
  EXPECT_FALSE(near.intersects(at(600)));
}

TEST(SensorMotions, LeadToTheCellsAhead) {
  SensorMotion motion;
  // A body and a camera a metre ahead of it.
  const auto at = [](double x) {
    return std::vector<SensorViewpoint>{{Vec3(x, 12, 12), 100.0}, {Vec3(x + 1.0, 12, 12), 200.0}};
  };
  EXPECT_THAT(motion.predict(at(0), 3), testing::Optional(testing::IsEmpty())) << "no way yet";
  EXPECT_EQ(motion.predict(at(0.5), 3), std::nullopt) << "hardly moved";
  const auto next = motion.predict(at(2), 3);
  ASSERT_TRUE(next);
  ASSERT_EQ(next->size(), 3U);
  EXPECT_EQ((*next)[0], cells_around(at(23.5))) << "the camera crosses first";
  EXPECT_EQ((*next)[0].size(), 2U);
  EXPECT_EQ((*next)[1], cells_around(at(30)));
  EXPECT_EQ((*next)[2], cells_around(at(47.5)));
  EXPECT_THAT(motion.predict(at(0), 3)->front(), testing::Eq(cells_around(at(-0.5)))) << "back";
  EXPECT_THAT(motion.predict(at(900), 3), testing::Optional(testing::IsEmpty())) << "a jump";
  EXPECT_EQ(motion.predict(at(902), 1)->size(), 1U);
}

}  // namespace
}  // namespace tileflight::simulator::sensor_cells_test
