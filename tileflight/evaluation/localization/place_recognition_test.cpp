#include "tileflight/evaluation/localization/place_recognition.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include "tileflight/core/base/input_error.h"
#include "tileflight/evaluation/localization/test_places.h"

namespace tileflight::localization::place_recognition_test {
namespace {

using geometry::Sim3;
using geometry::Vec3;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

/// As from odometry: arbitrary position, rotation and scale.
Sim3 T_map_local() {
  return {0.07, Eigen::Quaterniond(Eigen::AngleAxisd(2.1, Vec3(1.0, 2.0, -0.5).normalized())), Vec3(1.0, -2.0, 3.0)};
}

const test_places::Hills& the_place() {
  static const test_places::Hills place(1);
  return place;
}

/// `lean_rad`: error of the up direction.
FlightEvidence evidence_of(const test_places::Flight& flight, double lean_rad = 0.0) {
  const Vec3 up = T_map_local().rotation * (Eigen::AngleAxisd(lean_rad, Vec3::UnitY()) * Vec3::UnitZ());
  return {flight.pictures(T_map_local()), flight.points_in(T_map_local()), {up}};
}

double worst_m(const Sim3& T_local_map, const test_places::Flight& flight) {
  double worst = 0.0;
  for (const Vec3& p : flight.points) worst = std::max(worst, (T_local_map * (T_map_local() * p) - p).norm());
  return worst;
}

TEST(PlaceRecognition, FindsWhereAFlightWas) {
  const PlaceRecognizer recognizer(the_place().scene, the_place().scene.bounds());
  for (const double lean_rad : {0.0, 0.6}) {
    const test_places::Flight flight(the_place(), lean_rad);
    for (const double wrong_up_rad : {0.0, 0.05}) {
      const auto candidates = recognizer.find(evidence_of(flight, wrong_up_rad));
      ASSERT_FALSE(candidates.empty());
      EXPECT_LT(worst_m(candidates.front().T_local_map, flight), 1.5);
      EXPECT_GT(candidates.front().score(), 0.3);
      EXPECT_GT(candidates.front().inliers, 10U);
      for (std::size_t k = 1; k < candidates.size(); ++k) EXPECT_LT(candidates[k].score(), 0.3);
    }
  }
}

TEST(PlaceRecognition, TheRightOneOfTwoDirectionsIsEnough) {
  const test_places::Flight flight(the_place(), 0.0);
  FlightEvidence evidence = evidence_of(flight);
  evidence.up_candidates.insert(evidence.up_candidates.begin(), (T_map_local().rotation * Vec3::UnitX()).eval());
  const auto candidates = PlaceRecognizer(the_place().scene, the_place().scene.bounds()).find(evidence);
  ASSERT_FALSE(candidates.empty());
  EXPECT_LT(worst_m(candidates.front().T_local_map, flight), 1.5);
}

TEST(PlaceRecognition, AnotherPlaceIsNotRecognized) {
  const test_places::Hills other(50);
  const test_places::Flight flight(other, 0.0);
  for (const PlaceCandidate& candidate :
       PlaceRecognizer(the_place().scene, the_place().scene.bounds()).find(evidence_of(flight)))
    EXPECT_LT(candidate.score(), 0.3);
}

TEST(PlaceRecognition, NothingToGoByGivesNoCandidates) {
  const PlaceRecognizer recognizer(the_place().scene, the_place().scene.bounds());
  const test_places::Flight flight(the_place(), 0.0);
  FlightEvidence evidence = evidence_of(flight);
  evidence.up_candidates.clear();
  EXPECT_TRUE(recognizer.find(evidence).empty());
  evidence = evidence_of(flight);
  evidence.points.clear();
  EXPECT_TRUE(recognizer.find(evidence).empty());
  EXPECT_TRUE(recognizer.find({}).empty());
  // A place without textures.
  const scene::Scene bare({render::test_scenes::hills(Vec3(0, 0, 10), 100.0, 60, nullptr)});
  EXPECT_TRUE(PlaceRecognizer(bare, bare.bounds()).find(evidence_of(flight)).empty());
}

TEST(PlaceRecognition, APictureOfAnotherSizeIsAnError) {
  const test_places::Flight flight(the_place(), 0.0);
  FlightEvidence evidence = evidence_of(flight);
  evidence.pictures.picture = [](std::size_t) { return imaging::RgbImage(20, 10); };
  EXPECT_THAT([&] { PlaceRecognizer(the_place().scene, the_place().scene.bounds()).find(evidence); },
              ThrowsMessage<InputError>(HasSubstr("is 20x10, the calibration is for")));
}

TEST(PlaceRecognition, ThreadsDoNotMatter) {
  const test_places::Flight flight(the_place(), 0.3);
  const auto run = [&](std::size_t threads) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    return PlaceRecognizer(the_place().scene, the_place().scene.bounds()).find(evidence_of(flight));
  };
  const auto one = run(1), four = run(4);
  ASSERT_EQ(one.size(), four.size());
  for (std::size_t k = 0; k < one.size(); ++k) EXPECT_EQ(one[k].T_local_map.matrix(), four[k].T_local_map.matrix());
}

}  // namespace
}  // namespace tileflight::localization::place_recognition_test
