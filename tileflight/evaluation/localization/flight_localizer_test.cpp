#include "tileflight/evaluation/localization/flight_localizer.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "tileflight/core/base/input_error.h"
#include "tileflight/evaluation/localization/test_places.h"

namespace tileflight::localization::flight_localizer_test {
namespace {

using geometry::SE3;
using geometry::Sim3;
using geometry::Vec3;

const Sim3& T_map_local() {
  static const Sim3 kT(0.2, geometry::so3_exp({0.3, -0.2, 1.0}), Vec3(3.0, 2.0, -7.0));
  return kT;
}

/// The nine images of test_places::Flight with the poses of an odometry that drifts.
struct DriftingFlight {
  test_places::Hills place;
  test_places::Flight flight;
  FlightImages images;

  explicit DriftingFlight(int seed = 3) : place(seed), flight(place, 0.2) {
    SE3 drift;
    for (const SE3& pose : flight.pictures(T_map_local()).T_map_camera) {
      images.images.push_back({pose * drift, 0.004, 0.002});
      drift = drift * SE3(geometry::so3_exp({0.0, 0.001, 0.0}), Vec3(0.004, -0.003, 0.002));
    }
    images.read = [this](std::size_t i) { return flight.rendered[i]; };
  }

  LocatedFlight locate(const test_places::Hills& in, const FlightLocalizerOptions& options = {}) const {
    return locate_flight(PictureLocalizer(in.scene, flight.camera), images, T_map_local().inverse(), options);
  }
  double error_m(const LocatedFlight& located, std::size_t i) const {
    return (located.images[i].pose.T_local_camera.translation - flight.T_local_camera[i].translation).norm();
  }
};

TEST(FlightLocalizer, FindsEveryImageWhateverTheOdometrysDrift) {
  const DriftingFlight flight;
  const LocatedFlight located = flight.locate(flight.place);
  for (std::size_t i = 0; i < located.images.size(); ++i) {
    EXPECT_EQ(located.images[i].source, PoseSource::kPlace) << i;
    EXPECT_LT(flight.error_m(located, i), 0.03) << i;
    EXPECT_GT(located.images[i].correlation, 0.9) << i;
  }
}

TEST(FlightLocalizer, SectionsAndRenderingsDoNotChangeWhatIsFound) {
  const DriftingFlight flight;
  const LocatedFlight whole = flight.locate(flight.place);
  const LocatedFlight parts = flight.locate(flight.place, {.section = 2, .view_motion = 0.2});
  for (std::size_t i = 0; i < whole.images.size(); ++i) EXPECT_LT(flight.error_m(parts, i), 0.05) << i;
}

TEST(FlightLocalizer, ImagesThatShowSomethingElseAreCarriedByTheOdometry) {
  DriftingFlight flight;
  const test_places::Hills elsewhere(11);
  const test_places::Flight other(elsewhere, 0.2);
  flight.images.read = [&](std::size_t i) { return i == 3 || i == 4 ? other.rendered[i] : flight.flight.rendered[i]; };
  const LocatedFlight located = flight.locate(flight.place);
  for (std::size_t i = 0; i < located.images.size(); ++i) {
    EXPECT_EQ(located.images[i].source, i == 3 || i == 4 ? PoseSource::kOdometry : PoseSource::kPlace) << i;
    EXPECT_LT(flight.error_m(located, i), 0.1) << i;
  }
}

TEST(FlightLocalizer, ImagesThatTheOdometryLostAreFoundFromTheirNeighbours) {
  DriftingFlight flight;
  flight.images.images[4].T_map_camera.reset();
  const LocatedFlight located = flight.locate(flight.place, {.section = 3});
  EXPECT_LT(flight.error_m(located, 3), 0.03);
  EXPECT_LT(flight.error_m(located, 5), 0.03);
  // 4 m from image to image at 25 m is further than an image is searched; it is found, or lost, but not elsewhere.
  EXPECT_TRUE(located.images[4].source == PoseSource::kLost || flight.error_m(located, 4) < 0.03);
}

TEST(FlightLocalizer, AnOdometryThatGoesWrongIsNotBelieved) {
  DriftingFlight flight;
  // From the fourth image on the odometry moves by two thirds of the way, and is sure of it.
  std::vector<SE3> right;
  for (FlightImage& image : flight.images.images) {
    right.push_back(*image.T_map_camera);
    image.sigma_position = image.sigma_rotation_rad = 1e-5;
  }
  for (std::size_t i = 4; i < right.size(); ++i) {
    SE3 step = right[i - 1].inverse() * right[i];
    step.translation *= 0.67;
    flight.images.images[i].T_map_camera = *flight.images.images[i - 1].T_map_camera * step;
  }
  const LocatedFlight located = flight.locate(flight.place);
  for (std::size_t i = 0; i < located.images.size(); ++i) EXPECT_LT(flight.error_m(located, i), 0.1) << i;
}

TEST(FlightLocalizer, AnImageThatCannotBeDecodedIsCarried) {
  DriftingFlight flight;
  flight.images.read = [&](std::size_t i) { return i == 5 ? std::nullopt : std::optional(flight.flight.rendered[i]); };
  const LocatedFlight located = flight.locate(flight.place);
  EXPECT_EQ(located.images[5].source, PoseSource::kOdometry);
  EXPECT_LT(flight.error_m(located, 5), 0.1);
}

TEST(FlightLocalizer, AnotherPlaceIsRefused) {
  const DriftingFlight flight;
  EXPECT_THROW(flight.locate(test_places::Hills(11)), InputError);
}

}  // namespace
}  // namespace tileflight::localization::flight_localizer_test
