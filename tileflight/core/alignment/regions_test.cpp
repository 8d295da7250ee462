#include "tileflight/core/alignment/regions.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "tileflight/core/base/input_error.h"

namespace tileflight::alignment::region_list_test {
namespace {

using geometry::Box3;
using geometry::Vec3;
using nlohmann::json;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

TEST(RegionList, ToJsonAndBack) {
  const RegionList list{{Box3(Vec3(0, 1, 2), Vec3(3, 4, 5.5))}, {Box3(Vec3(-9, 0, 0), Vec3(-8, 1, 1))}, true};
  const RegionList back = regions_from_json(json::parse(to_json(list).dump()), "transform.json");
  ASSERT_EQ(back.aligned_on.size(), 1u);
  ASSERT_EQ(back.held_out.size(), 1u);
  EXPECT_TRUE(back.aligned_on[0].isApprox(list.aligned_on[0]));
  EXPECT_TRUE(back.held_out[0].isApprox(list.held_out[0]));
  EXPECT_TRUE(back.found);
  EXPECT_TRUE(regions_from_json(json::object(), "transform.json").aligned_on.empty());
}

TEST(RegionList, RefusesWhatIsNone) {
  const auto expect_refused = [](const char* text, const char* message) {
    EXPECT_THAT([&] { regions_from_json(json::parse(text), "transform.json"); },
                ThrowsMessage<InputError>(HasSubstr(message)))
        << text;
  };
  expect_refused("[]", "transform.json: 'regions' must be an object");
  expect_refused("3", "transform.json: 'regions' must be an object");
  expect_refused(R"({"held_out": 1})", "'held_out' must be a list of regions");
  expect_refused(R"({"held_out": [1]})", "a region needs 'center', three numbers");
  expect_refused(R"({"held_out": [{"center": [1, 2]}]})", "a region needs 'center', three numbers");
  expect_refused(R"({"aligned_on": [{"center": [1, 2, 3], "size": [1, 1, 0]}]})",
                 "the size of a region must be positive");
  expect_refused(R"({"aligned_on": [{"center": [1, 2, "x"], "size": [1, 1, 1]}]})",
                 "a region needs 'center', three numbers");
}

}  // namespace
}  // namespace tileflight::alignment::region_list_test
