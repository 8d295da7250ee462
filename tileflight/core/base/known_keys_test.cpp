#include "tileflight/core/base/known_keys.h"

#include <gtest/gtest.h>

namespace tileflight::base::known_keys_test {
namespace {

/// The recursive definition itself, exponential in the lengths.
std::size_t edit_distance_by_definition(std::string_view a, std::string_view b) {
  if (a.empty()) return b.size();
  if (b.empty()) return a.size();
  const std::size_t substituted =
      edit_distance_by_definition(a.substr(1), b.substr(1)) + (a.front() == b.front() ? 0 : 1);
  const std::size_t deleted = edit_distance_by_definition(a.substr(1), b) + 1;
  const std::size_t inserted = edit_distance_by_definition(a, b.substr(1)) + 1;
  return std::min({substituted, deleted, inserted});
}

TEST(EditDistance, KnownValues) {
  EXPECT_EQ(edit_distance("kitten", "sitting"), 3U);
  EXPECT_EQ(edit_distance("", "abc"), 3U);
  EXPECT_EQ(edit_distance("abc", ""), 3U);
  EXPECT_EQ(edit_distance("same", "same"), 0U);
}

TEST(EditDistance, EqualsItsRecursiveDefinition) {
  const std::vector<std::string> words = {"", "a", "ab", "ba", "abc", "cab", "fps", "fsp", "voxel", "vexol", "edges"};
  for (const auto& a : words) {
    for (const auto& b : words) {
      EXPECT_EQ(edit_distance(a, b), edit_distance_by_definition(a, b)) << a << " " << b;
    }
  }
}

TEST(NearestKey, NamesTheMostSimilar) {
  EXPECT_EQ(nearest_key("trajectry", {"camera", "trajectory", "fps"}), "trajectory");
  EXPECT_EQ(nearest_key("fsp", {"camera", "fps"}), "fps");
}

TEST(NearestKey, FirstOfEqualsAndEmptyWithoutKeys) {
  EXPECT_EQ(nearest_key("x", {"a", "b"}), "a");
  EXPECT_EQ(nearest_key("x", {}), "");
}

TEST(DidYouMean, NamesWhatIsNearAndNothingElse) {
  const std::vector<std::string> commands{"extract", "render", "evaluate", "tile", "run"};
  EXPECT_EQ(did_you_mean("rnder", commands), "; did you mean 'render'?");
  EXPECT_EQ(did_you_mean("Extract", commands), "; did you mean 'extract'?");
  EXPECT_EQ(did_you_mean("eval", commands), "; did you mean 'evaluate'?");
  EXPECT_EQ(did_you_mean("tlie", commands), "; did you mean 'tile'?") << "two letters that changed places";
  EXPECT_EQ(did_you_mean("photogrammetry", commands), "");
  EXPECT_EQ(did_you_mean("x", {}), "");
}

}  // namespace
}  // namespace tileflight::base::known_keys_test
