#include "tileflight/evaluation/metrics/moving_points.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <random>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/strict_section.h"

namespace tileflight::metrics::moving_points_test {
namespace {

using geometry::Vec3;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

/// Corners of the box with its margins, by its axes drawn in the local frame.
struct DrawnBox {
  Vec3 corner, along[3];

  /// `box`: rotated by `yaw_rad` about the vertical, then by `pitch_rad` about its own left axis.
  DrawnBox(const Vec3& center, const Vec3& size, double yaw_rad, double pitch_rad, const BoxMargins& m) {
    const double c = std::cos(yaw_rad), s = std::sin(yaw_rad), p = std::cos(pitch_rad), q = std::sin(pitch_rad);
    const Vec3 forward(c * p, s * p, -q), left(-s, c, 0), up(c * q, s * q, p);
    const double lifted = std::min(m.lifted_m, size.z() / 3);
    corner = center - (size.x() / 2 + m.grown_m) * forward - (size.y() / 2 + m.grown_m) * left +
             (lifted - size.z() / 2) * up;
    along[0] = (size.x() + 2 * m.grown_m) * forward;
    along[1] = (size.y() + 2 * m.grown_m) * left;
    along[2] = (size.z() + m.grown_m - lifted) * up;
  }
  /// By the six half-spaces of its faces, each through three corners.
  bool contains(const Vec3& p) const {
    for (int axis = 0; axis < 3; ++axis) {
      const Vec3 normal = along[(axis + 1) % 3].cross(along[(axis + 2) % 3]);
      const double at = normal.dot(p - corner);
      if (at < 0 || at > normal.dot(along[axis])) return false;
    }
    return true;
  }
};

TEST(MovingPoints, AreThoseWithinTheGrownBox) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> angle(-3.0, 3.0), slope(-0.3, 0.3), size(0.4, 5.0), place(-4.0, 4.0);
  int inside = 0, outside = 0;
  for (int trial = 0; trial < 200; ++trial) {
    const Vec3 center(place(random), place(random), place(random)), sizes(size(random), size(random), size(random));
    const double yaw = angle(random), pitch = slope(random);
    PlacedBox box{{}, sizes};
    box.T_local_box.rotation = Eigen::AngleAxisd(yaw, Vec3::UnitZ()) * Eigen::AngleAxisd(pitch, Vec3::UnitY());
    box.T_local_box.translation = center;
    const BoxMargins margins{.grown_m = 0.25, .lifted_m = trial % 2 == 0 ? 0.3 : 0.0};
    const DrawnBox oracle(center, sizes, yaw, pitch, margins);
    for (int k = 0; k < 200; ++k) {
      const Vec3 p = center + Vec3(place(random), place(random), place(random));
      EXPECT_EQ(is_on(box, p, margins), oracle.contains(p));
      ++(oracle.contains(p) ? inside : outside);
    }
  }
  EXPECT_GT(inside, 2000);
  EXPECT_GT(outside, 2000);
}

TEST(MovingPoints, TheGroundBelowIsThePlaces) {
  const PlacedBox car{{Eigen::Quaterniond::Identity(), Vec3(10, 0, 0.75)}, Vec3(4, 2, 1.5)};
  EXPECT_FALSE(is_on(car, Vec3(10, 0, 0.1)));
  EXPECT_TRUE(is_on(car, Vec3(10, 0, 0.4)));
  EXPECT_TRUE(is_on(car, Vec3(12.1, 1.1, 1.6)));
  const PlacedBox flat{{Eigen::Quaterniond::Identity(), Vec3(0, 0, 0.15)}, Vec3(1, 1, 0.3)};
  EXPECT_TRUE(is_on(flat, Vec3(0, 0, 0.11))) << "of a low thing, two thirds remain";
}

TEST(MovingPoints, ScoresOfAPart) {
  const PointScores some = score_points({0.3, 0.5, 7.0}, std::vector<double>{0.1, 0.2, 6.0}, 1.0);
  EXPECT_EQ(some.points, 3U);
  EXPECT_EQ(some.voxel.count, 2U);
  EXPECT_NEAR(some.voxel.mean, 0.4, 1e-12);
  ASSERT_TRUE(some.surface);
  EXPECT_NEAR(some.surface->mean, 2.1, 1e-12) << "without cut-off";
  const PointScores none = score_points({}, std::nullopt, 1.0);
  EXPECT_EQ(none.points, 0U);
  EXPECT_TRUE(std::isnan(none.voxel.mean));
  EXPECT_FALSE(none.surface);
}

TEST(MovingPoints, JsonAndBack) {
  const MovingPoints moving{.objects = 5,
                            .by_keyframe = true,
                            .margins = {0.2, 0.3},
                            .apart = score_points({0.9}, std::vector<double>{0.8}, 1.0),
                            .with_them = score_points({0.1, 0.2, 0.3, 0.9}, std::nullopt, 1.0)};
  nlohmann::json written = nlohmann::json::parse(to_json(moving).dump());
  EXPECT_EQ(written["share"], 0.25);
  EXPECT_EQ(to_json(read_moving_points(base::StrictSection(written, "metrics.json"))).dump(), to_json(moving).dump());
  written["at"] = "noon";
  EXPECT_THAT([&] { read_moving_points(base::StrictSection(written, "metrics.json")); },
              ThrowsMessage<InputError>(HasSubstr("'at' must be")));
  written["at"] = "any-time";
  written["points"] = 9;
  EXPECT_THAT([&] { read_moving_points(base::StrictSection(written, "metrics.json")); },
              ThrowsMessage<InputError>(HasSubstr("must not exceed")));
}

}  // namespace
}  // namespace tileflight::metrics::moving_points_test
