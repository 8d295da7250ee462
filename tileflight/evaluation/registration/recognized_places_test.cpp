#include "tileflight/evaluation/registration/recognized_places.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tileflight/core/alignment/similarity_chart.h"
#include "tileflight/evaluation/registration/test_flights.h"

namespace tileflight::registration::recognized_places_test {
namespace {

using namespace test_flights;
using testing::HasSubstr;

/// A spot of the place where the images are located: `aside` of where they were taken, so many of each ten, with that
/// correlation.
struct Spot {
  Vec3 aside = Vec3::Zero();
  std::size_t of_ten = 10;
  double correlation = 0.95;
};

Sim3 moved(const Spot& spot) {
  Sim3 T = T_local_map();
  T.translation += spot.aside;
  return T;
}

/// Localization in a place that has several such spots: at the one near the guess, within a centimetre.
LocatedPictures locate_at(const std::vector<Spot>& spots, const Flight& flight, const Sim3& T, std::size_t pictures) {
  LocatedPictures result{.tried = pictures};
  std::mt19937_64 random(9);
  std::normal_distribution<double> normal;
  for (std::size_t k = 0; k < pictures; ++k) {
    const std::size_t pose = k * flight.map.size() / pictures;
    for (const Spot& spot : spots) {
      SE3 found = flight.local.poses[pose].T_local_camera;
      found.translation += spot.aside + 0.01 * Vec3(normal(random), normal(random), normal(random));
      const SE3 guess = T * flight.map.poses[pose].T_local_camera;
      constexpr double kCapture_m = 2.0;
      if ((guess.translation - found.translation).norm() > kCapture_m || (3 * k) % 10 >= spot.of_ten) continue;
      LocatedPose located{flight.map.poses[pose].T_local_camera, found};
      located.information.diagonal() << 1e4, 1e4, 1e4, 1e6, 1e6, 1e6;
      result.found.push_back({pose, located, spot.correlation});
    }
  }
  return result;
}

RegistrationResult registered(const std::vector<Spot>& spots, bool with_start = false) {
  static const Flight flight = simulate_map(curved_path(), 60);
  RegistrationServices services;
  services.locate_pictures = [&](const Sim3& T, std::size_t n, PictureDetail) {
    return locate_at(spots, flight, T, n);
  };
  services.find_places_by_appearance = [&] {
    std::vector<Sim3> places;
    for (const Spot& spot : spots) places.push_back(moved(spot));
    return places;
  };
  RegistrationEvidence evidence{.path = flight.map};
  if (with_start) evidence.starts = {moved(spots.front())};
  return register_map(flight.points, evidence, the_place().surface, services);
}

double error_m(const RegistrationResult& r, const Spot& spot) {
  return (r.T_local_map.translation - moved(spot).translation).norm();
}

std::string withheld(const RegistrationResult& r) {
  std::string text;
  for (const Warning& warning : r.warnings)
    if (forbids_verdict(warning)) text += warning.message + "\n";
  return text;
}

TEST(RecognizedPlaces, ThePlaceWhereMorePicturesAreLocatedIsTaken) {
  const Spot similar{Vec3(30, 0, 0), 6, 0.95}, right{Vec3::Zero(), 10, 0.95};
  const RegistrationResult r = registered({similar, right});
  EXPECT_LT(error_m(r, right), 0.05);
  EXPECT_EQ(withheld(r), "");
}

TEST(RecognizedPlaces, WhereAsManyAreLocatedTheBetterCorrelationIsTaken) {
  const Spot similar{Vec3(30, 0, 0), 10, 0.7}, right{Vec3::Zero(), 10, 0.95};
  const RegistrationResult r = registered({similar, right});
  EXPECT_LT(error_m(r, right), 0.05);
  EXPECT_EQ(withheld(r), "");
}

/// Roof tiles, shifted by one ridge: all images are located there, too.
TEST(RecognizedPlaces, AMuchBetterCorrelationOutweighsAFewMoreImages) {
  const Spot similar{Vec3(4, 0, 0), 10, 0.745}, right{Vec3::Zero(), 9, 0.98};
  const RegistrationResult r = registered({similar, right});
  EXPECT_LT(error_m(r, right), 0.05);
  EXPECT_EQ(withheld(r), "");
}

TEST(RecognizedPlaces, TwoThatFitAlikeAreAmbiguous) {
  const RegistrationResult r = registered({{Vec3(30, 0, 0), 10, 0.95}, {Vec3::Zero(), 10, 0.94}});
  ASSERT_TRUE(r.similar_place_distance_m);
  EXPECT_NEAR(*r.similar_place_distance_m, 30.0, 0.1);
  EXPECT_THAT(withheld(r), HasSubstr("ambiguous: the images fit as well 30.0 m away"));
}

TEST(RecognizedPlaces, OnePlaceThatIsFoundTwiceIsNotAmbiguous) {
  const RegistrationResult r = registered({{Vec3::Zero(), 10, 0.95}, {Vec3(0.05, 0, 0), 10, 0.95}});
  EXPECT_FALSE(r.similar_place_distance_m);
  EXPECT_EQ(withheld(r), "");
}

TEST(RecognizedPlaces, HalfOfThePicturesIsTooFewForAPlaceThatWasSearched) {
  EXPECT_THAT(withheld(registered({{Vec3::Zero(), 6, 0.95}})), HasSubstr("of 20 images agree on it"));
  EXPECT_EQ(withheld(registered({{Vec3::Zero(), 6, 0.95}}, true)), "");  // a start was given: only a note
  EXPECT_EQ(withheld(registered({{Vec3::Zero(), 8, 0.95}})), "");
}

/// The receiver is too far off for the images to be located from it; then the place is searched.
TEST(RecognizedPlaces, PositionsTellWhichOfSeveralPlacesIsMeant) {
  const Flight flight = simulate_map(curved_path(), 60);
  const std::vector<Spot> spots = {{Vec3(30, 0, 0), 10, 0.95}, {Vec3::Zero(), 10, 0.85}};
  bool is_searched = false;
  RegistrationServices services;
  services.locate_pictures = [&](const Sim3& T, std::size_t n, PictureDetail) {
    return is_searched ? locate_at(spots, flight, T, n) : LocatedPictures{n, {}};
  };
  services.find_places_by_appearance = [&] {
    is_searched = true;
    return std::vector<Sim3>{moved(spots[0]), moved(spots[1])};
  };
  RegistrationEvidence evidence{.path = flight.map};
  for (const auto& pose : flight.local.poses)
    evidence.positions.push_back({pose.time_s, pose.T_local_camera.translation + Vec3(1.5, -1.0, 0.5), 0.6, 0.9});
  RegistrationOptions options;
  options.trajectory.estimate_time_offset = false;
  const RegistrationResult r = register_map(flight.points, evidence, the_place().surface, services, options);
  EXPECT_EQ(r.start, kSearchedStart);
  EXPECT_LT(error_m(r, spots[1]), 0.05);
  EXPECT_EQ(withheld(r), "");
}

/// Over clutter, rays that pass an edge meet what is behind or before. The place is still the one that the receiver
/// tells, which is not asked of flights that did not have to search.
TEST(RecognizedPlaces, ASearchedPlaceWhereTheReceiverIsNeedsNoRays) {
  const Flight flight = simulate_map(curved_path(), 60);
  const std::vector<Spot> spots = {{Vec3::Zero(), 10, 0.95}};
  bool is_searched = false;
  RegistrationServices services;
  services.cast_ray = [](const Vec3& origin, const Vec3& direction, double reach_m) -> std::optional<double> {
    const auto met_m = cast_ray(origin, direction, reach_m);
    return met_m ? std::optional(0.5 * *met_m) : std::nullopt;
  };
  services.locate_pictures = [&](const Sim3& T, std::size_t n, PictureDetail) {
    return is_searched ? locate_at(spots, flight, T, n) : LocatedPictures{n, {}};
  };
  services.find_places_by_appearance = [&] {
    is_searched = true;
    return std::vector<Sim3>{moved(spots[0])};
  };
  RegistrationOptions options;
  options.trajectory.estimate_time_offset = false;
  const auto withheld_with_receiver_off_by = [&](const Vec3& off) {
    is_searched = false;
    RegistrationEvidence evidence{.path = flight.map};
    for (const auto& pose : flight.local.poses)
      evidence.positions.push_back({pose.time_s, pose.T_local_camera.translation + off, 0.8, 0.9});
    const RegistrationResult r = register_map(flight.points, evidence, the_place().surface, services, options);
    EXPECT_EQ(r.start, kSearchedStart);
    EXPECT_TRUE(r.rays);
    return withheld(r);
  };
  EXPECT_EQ(withheld_with_receiver_off_by(Vec3(1.5, -1.0, 0.5)), "");
  EXPECT_THAT(withheld_with_receiver_off_by(Vec3(2.8, -2.0, 0.5)), HasSubstr("seen from its own cameras"));
}

/// The map of another roof: its images fit in the looks, its points do not.
TEST(RecognizedPlaces, ASearchedPlaceWhoseShapeDisagreesIsWarninged) {
  const Flight flight = simulate_map(curved_path(), 60);
  RegistrationServices services;
  const std::vector<Spot> spots = {{Vec3(14, 9, 0), 10, 0.95}};
  services.cast_ray = cast_ray;
  services.locate_pictures = [&](const Sim3& T, std::size_t n, PictureDetail) {
    return locate_at(spots, flight, T, n);
  };
  services.find_places_by_appearance = [&] { return std::vector<Sim3>{moved(spots.front())}; };
  const RegistrationResult r = register_map(flight.points, {.path = flight.map}, the_place().surface, services);
  EXPECT_THAT(withheld(r), HasSubstr("seen from its own cameras, the map does not match the place"));
}

}  // namespace
}  // namespace tileflight::registration::recognized_places_test
