// Odometry with each lens model, without rectification, on a rendered scene with known truth.

#include <gtest/gtest.h>

#include "tileflight/slam/odometry/synthetic_flight.h"

namespace tileflight::odometry::lenses_test {
namespace {

using imaging::Camera;

struct Case {
  const char* name;
  Camera camera;
};

void PrintTo(const Case& lens, std::ostream* stream) { *stream << lens.name; }

class NativeLens : public testing::TestWithParam<Case> {};

/// Ground covered by a pixel at the image centre from 12 m above, metres.
double ground_pixel_m(const Camera& camera) {
  const geometry::Vec2 middle(camera.width() / 2.0, camera.height() / 2.0);
  return 12.0 * (camera.unproject(middle).value() - camera.unproject(middle + geometry::Vec2(1.0, 0.0)).value()).norm();
}

TEST_P(NativeLens, FollowsAFlight) {
  const test_support::Sequence sequence = test_support::render_hill_flight(GetParam().camera, 30);
  const OdometryResult result = run_odometry(sequence.calibration, sequence.source(), test_support::small_options());
  EXPECT_FALSE(result.lost) << result.lost_reason;
  EXPECT_GE(result.frames_tracked, 28);
  const double pixel_m = ground_pixel_m(GetParam().camera);
  EXPECT_LT(test_support::relative_ate(result.trajectory, sequence.truth) * test_support::path_length_m(sequence.truth),
            0.25 * pixel_m);
  ASSERT_GT(result.map.size(), 200U);
  EXPECT_LT(base::upper_median(test_support::height_errors_m(test_support::hilly_ground(), result, sequence.truth)),
            1.4 * pixel_m);
}

INSTANTIATE_TEST_SUITE_P(
    Every, NativeLens,
    testing::Values(
        Case{"double sphere", Camera(imaging::DoubleSphere{100, 100, 139.5, 99.5, -0.17, 0.59}, 280, 200)},
        Case{"double sphere beyond 180 degrees",
             Camera(imaging::DoubleSphere{80, 80, 139.5, 79.5, 0.4, 0.62}, 280, 160)},
        Case{"unified", Camera(imaging::UnifiedModel{230, 231, 141, 98, 1.1, {-0.05, 0.01, 2e-3, -1e-3}}, 280, 200)},
        Case{"unified beyond 180 degrees", Camera(imaging::UnifiedModel{105, 105, 139.5, 79.5, 1.0, {}}, 280, 160)},
        Case{"extended unified", Camera(imaging::ExtendedUnifiedModel{120, 120, 139.5, 99.5, 0.6, 1.1}, 280, 200)},
        Case{"Kannala-Brandt beyond 180 degrees", imaging::make_fisheye(280, 160, 200.0)},
        Case{"rational", Camera(
                             imaging::PinholeRational{
                                 180, 181, 141, 98, {0.3, 0.1, 1e-3, -1e-3, 0.02, 0.5, 0.1, 0.01, 1e-3, 0, 1e-3, 0}},
                             280, 200)},
        Case{"panorama", imaging::make_panorama(480, 240)},
        Case{"radtan", Camera(imaging::PinholeRadtan{180, 181, 141, 98, {-0.2, 0.05, 1e-3, -1e-3}}, 280, 200)}),
    [](const testing::TestParamInfo<Case>& lens) {
      std::string name = lens.param.name;
      std::erase_if(name, [](char c) { return c == ' ' || c == '-'; });
      return name;
    });

TEST(NativeLenses, OfTheTestReallySeeBehindThemselves) {
  EXPECT_GT(Camera(imaging::DoubleSphere{80, 80, 139.5, 79.5, 0.4, 0.62}, 280, 160).horizontal_fov_deg(), 185.0);
  EXPECT_GT(Camera(imaging::UnifiedModel{105, 105, 139.5, 79.5, 1.0, {}}, 280, 160).horizontal_fov_deg(), 185.0);
}

}  // namespace
}  // namespace tileflight::odometry::lenses_test
