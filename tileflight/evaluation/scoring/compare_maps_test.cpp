#include "tileflight/evaluation/scoring/compare_maps.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/refusal.h"
#include "tests/temporary_folder.h"
#include "tileflight/core/base/files.h"

namespace tileflight::scoring::compared_maps_test {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::HasSubstr;
using tests::refusal_of;

class ComparedMaps : public testing::Test {
 protected:
  /// A scored flight; only the files' names matter here.
  fs::path scored(const std::string& flight) {
    fs::create_directories(folder_ / flight);
    base::write_file(folder_ / flight / "metrics.json", "{}");
    return folder_ / flight / "metrics.json";
  }
  static std::vector<std::string> names(const std::vector<FoundMap>& maps) {
    std::vector<std::string> all;
    for (const FoundMap& map : maps) all.push_back(map.name);
    return all;
  }
  tests::TemporaryFolder folder_;
};

TEST_F(ComparedMaps, NamesAreAsLongAsItTakes) {
  scored("quito/run/simulated");
  scored("quito/run/real");
  scored("paphos/run/simulated");
  scored("paphos/other/simulated");
  const auto maps = find_maps({folder_ / "quito/run", folder_ / "paphos/run/", folder_ / "paphos/other/simulated"});
  EXPECT_THAT(names(maps), ElementsAre("quito/run/simulated", "run/real", "paphos/run/simulated", "other/simulated"));
}

TEST_F(ComparedMaps, TheSameMapTwiceHasANumber) {
  const fs::path file = scored("out/run/real");
  const auto maps = find_maps({file, folder_ / "out/run", folder_ / "out/./run/real"});
  EXPECT_THAT(names(maps), ElementsAre("run/real", "run/real #2", "run/real #3"));
}

TEST_F(ComparedMaps, VariantsAreFoundAndNamedByTheirRun) {
  for (const char* run : {"a", "b"})
    for (const char* flight : {"simulated", "real", "variants/dark/simulated", "variants/0-bright/simulated"})
      scored(std::string(run) + "/" + flight);
  fs::create_directories(folder_ / "a/variants/failed/simulated");  // found no map
  EXPECT_THAT(names(find_maps({folder_ / "a", folder_ / "b"})),
              ElementsAre("a/simulated", "a/real", "a/0-bright/simulated", "a/dark/simulated", "b/simulated", "b/real",
                          "b/0-bright/simulated", "b/dark/simulated"));
  EXPECT_THAT(names(find_maps({folder_ / "a/variants/dark"})), ElementsAre("a/dark/simulated"));
}

TEST_F(ComparedMaps, RunsOfAFlightAreOneMap) {
  for (const char* flight : {"a/real", "a/real/runs/2", "a/real/runs/10", "a/real/runs/3"}) scored(flight);
  base::write_file(folder_ / "a/real/runs/3/failed.txt", "lost");
  const auto maps = find_maps({folder_ / "a"});
  ASSERT_EQ(maps.size(), 1U);
  EXPECT_EQ(maps[0].metrics_files.size(), 3U);
  EXPECT_EQ(maps[0].metrics_files[0], folder_ / "a/real/metrics.json");
}

TEST_F(ComparedMaps, RowsAreChosenByPatternInItsOrder) {
  for (const char* flight : {"a/simulated", "a/real", "b/simulated", "b/real"}) scored(flight);
  const auto maps = find_maps({folder_ / "a", folder_ / "b"});
  EXPECT_THAT(names(choose_maps(maps, {"*/real"})), ElementsAre("a/real", "b/real"));
  EXPECT_THAT(names(choose_maps(maps, {"b/*", "a/simulated", "*/simulated"})),
              ElementsAre("b/simulated", "b/real", "a/simulated"));
  EXPECT_THAT(refusal_of([&] {
                choose_maps(maps, {"*/real", "b/reel"});
              }),
              HasSubstr("row 'b/reel': matches none of the maps; did you mean 'b/real'?"));
}

TEST_F(ComparedMaps, TheBaselineIsOneMap) {
  for (const char* flight : {"a/simulated", "a/real", "b/simulated", "c/a/real"}) scored(flight);
  const auto maps = find_maps({folder_ / "a", folder_ / "b"});
  EXPECT_EQ(find_baseline(maps, "a/real").name, "a/real");
  EXPECT_EQ(find_baseline(maps, "b/*").name, "b/simulated");
  EXPECT_EQ(find_baseline(maps, (folder_ / "b").string()).name, "b/simulated");
  const FoundMap outside = find_baseline(maps, (folder_ / "c/a").string());
  EXPECT_EQ(outside.name, "a/real (baseline)");
  EXPECT_EQ(outside.metrics_files.front(), folder_ / "c/a/real/metrics.json");
  EXPECT_THAT(refusal_of([&] { find_baseline(maps, "a/*"); }),
              HasSubstr("names 2 maps (a/simulated, a/real): name one"));
  EXPECT_THAT(refusal_of([&] { find_baseline(maps, (folder_ / "a").string()); }), HasSubstr("names 2 maps"));
  EXPECT_THAT(refusal_of([&] { find_baseline(maps, "a/reel"); }), HasSubstr("did you mean 'a/real'?"));
}

TEST_F(ComparedMaps, AFolderWithoutMapsIsRefused) {
  EXPECT_THAT(refusal_of([&] { find_maps({folder_.path()}); }), HasSubstr("contains no scored map"));
}

}  // namespace
}  // namespace tileflight::scoring::compared_maps_test
