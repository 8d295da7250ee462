#include "tileflight/experiments/study/study_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/refusal.h"
#include "tests/tiny_flight.h"
#include "tileflight/experiments/study/test_study.h"

namespace tileflight::study::study_file_test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using tests::refusal_of;

class StudyFileTest : public ::testing::Test {
 protected:
  StudyFile read(const std::string& text) { return read_study(made_.study(text)); }
  std::string refusal(const std::string& text) {
    return refusal_of([&] { read(text); });
  }
  static std::string with(const std::string& more) { return test_support::StudyFolder::kStudy + more; }
  test_support::StudyFolder made_;
};

TEST_F(StudyFileTest, ListsPlacesSystemsAndFlights) {
  const StudyFile study =
      read(with("cameras: {wide: camera.yaml}\nexcept:\n  - {system: bad, place: two, reason: slow}\n"));
  EXPECT_EQ(study.name, "test");
  EXPECT_EQ(study.repetitions, 2);
  ASSERT_EQ(study.places.size(), 2U);
  EXPECT_THAT(study.places[0].flights, ElementsAre("simulated", "real"));
  EXPECT_THAT(study.places[1].flights, ElementsAre("simulated"));
  ASSERT_EQ(study.cameras.size(), 1U);
  EXPECT_EQ(study.cameras[0].name, "wide");
  ASSERT_EQ(study.systems.size(), 2U);
  EXPECT_EQ(study.systems[1].adapter.name, "bad");
  ASSERT_EQ(study.exceptions.size(), 1U);
  EXPECT_EQ(study.exceptions[0].reason, "slow");
}

TEST_F(StudyFileTest, APlaceMayChooseItsFlights) {
  const StudyFile study = read(
      "places: {one: {experiment: first.yaml, flights: [real]}}\nsystems: {good: {adapter: adapters/good, "
      "time_limit: 60, memory_limit: 2}}\n");
  EXPECT_THAT(study.places[0].flights, ElementsAre("real"));
  EXPECT_EQ(study.systems[0].time_limit_s, 60.0);
  EXPECT_EQ(study.systems[0].memory_limit_gb, 2.0);
  ASSERT_EQ(study.cameras.size(), 1U);
  EXPECT_EQ(study.cameras[0].name, "");
}

TEST_F(StudyFileTest, EntriesMayShareASiteAndNameTheirKind) {
  const StudyFile study = read(
      "places:\n  one-1: {experiment: first.yaml, site: one, kind: orbit}\n  two: second.yaml\n"
      "systems: {good: {adapter: adapters/good}}\n");
  EXPECT_EQ(study.places[0].site, "one");
  EXPECT_EQ(study.places[0].kind, "orbit");
  EXPECT_EQ(study.places[1].site, "two");
  EXPECT_EQ(study.places[1].kind, "");
  EXPECT_THAT(
      refusal("places: {one: {experiment: first.yaml, site: a b}}\nsystems: {good: {adapter: adapters/good}}\n"),
      HasSubstr("names hold letters"));
}

constexpr const char* kSystems = "systems: {good: {adapter: adapters/good}}\n";

TEST_F(StudyFileTest, APlaceMayBeDatasetsFromElsewhere) {
  tests::TinyFlight::copy_to(made_.folder / "recorded");
  const StudyFile study = read(std::string(kSystems) +
                               "rank_by: ate\nplaces: {hills: {datasets: {east: recorded, west: recorded}}}\n"
                               "except:\n  - {flight: west, reason: the same}\n");
  ASSERT_EQ(study.places.size(), 1U);
  EXPECT_TRUE(study.places[0].experiment.empty());
  EXPECT_THAT(study.places[0].flights, ElementsAre("east", "west"));
  EXPECT_EQ(study.places[0].datasets.at("east"), (made_.folder / "recorded").lexically_normal());
}

TEST_F(StudyFileTest, FaultsOfDatasetsAreNamed) {
  tests::TinyFlight::copy_to(made_.folder / "recorded");
  tests::TinyFlight::copy_to(made_.folder / "untrue");
  std::filesystem::remove(made_.folder / "untrue/groundtruth.txt");
  const auto refused = [&](const std::string& place, const std::string& more = "rank_by: ate\n") {
    return refusal(std::string(kSystems) + more + "places: {hills: {" + place + "}}\n");
  };
  EXPECT_THAT(refused("datasets: {east: recorded}", ""), HasSubstr("use `rank_by: ate`"));
  EXPECT_THAT(refused("datasets: {east: untrue}"), HasSubstr("has no true poses"));
  EXPECT_THAT(refused("datasets: {east: none}"), HasSubstr("which does not exist"));
  EXPECT_THAT(refused("datasets: {east: adapters}"), HasSubstr("adapters"));
  EXPECT_THAT(refused("datasets: {a/b: recorded}"), HasSubstr("names hold letters"));
  EXPECT_THAT(refused("datasets: {}"), HasSubstr("is empty"));
  EXPECT_THAT(refused("datasets: {east: recorded}, experiment: first.yaml"), HasSubstr("give each its own place"));
  EXPECT_THAT(refused("datasets: {east: recorded}, flights: [east]"), HasSubstr("are those of `datasets`"));
  EXPECT_THAT(refused("datasets: {east: recorded}", "rank_by: ate\nexcept: [{flight: wets}]\n"),
              HasSubstr("which is not in this study"));
}

TEST_F(StudyFileTest, FaultsAreNamed) {
  EXPECT_THAT(refusal("systems: {good: {adapter: adapters/good}}\n"), HasSubstr("places"));
  EXPECT_THAT(refusal("places: {one: first.yaml}\n"), HasSubstr("systems"));
  EXPECT_THAT(refusal("places: {one: none.yaml}\nsystems: {good: }\n"), HasSubstr("which does not exist"));
  EXPECT_THAT(refusal("places: {a/b: first.yaml}\nsystems: {good: }\n"), HasSubstr("names hold letters"));
  EXPECT_THAT(refusal("places: {one: {experiment: second.yaml, flights: [real]}}\nsystems: {good: }\n"),
              HasSubstr("which is no flight of"));
  EXPECT_THAT(refusal("places: {one: {experiment: first.yaml, flights: [real, real]}}\nsystems: {good: }\n"),
              HasSubstr("has 'real' twice"));
  EXPECT_THAT(refusal("places: {one: {experiment: first.yaml, flights: []}}\nsystems: {good: }\n"),
              HasSubstr("is empty"));
  EXPECT_THAT(refusal("places: {one: first.yaml, one: second.yaml}\nsystems: {good: }\n"), HasSubstr("is there twice"));
  EXPECT_THAT(refusal(with("systems: {good: }\n")), HasSubstr("'systems' is there twice"));
  EXPECT_THAT(refusal("places: {one: first.yaml}\nsystems: {good: }\nrepetitions: 0\n"), HasSubstr("out of range"));
  EXPECT_THAT(refusal("places: {one: first.yaml}\nsystems: {colmpa: }\n"), HasSubstr("has no adapter"));
  EXPECT_THAT(refusal(with("except:\n  - {system: godo}\n")), HasSubstr("did you mean 'good'?"));
  EXPECT_THAT(refusal(with("except:\n  - {reason: none}\n")), HasSubstr("excludes everything"));
  EXPECT_THAT(refusal(with("threshold: 0.3\n")), HasSubstr("is not one of the thresholds"));
  EXPECT_THAT(refusal(with("repetition: 3\n")), HasSubstr("did you mean 'repetitions'?"));
  EXPECT_THAT(refusal(with("alignment: {strat: auto}\n")), HasSubstr("start"));
}

}  // namespace
}  // namespace tileflight::study::study_file_test
