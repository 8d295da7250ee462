// Commands state the cost of their work before they start, and refuse at once what is too large.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "tests/run_program.h"
#include "tests/test_data.h"
#include "tests/tiny_place.h"

namespace tileflight::costs_test {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using ::testing::HasSubstr;
using ::testing::Not;
using tests::ProgramResult;
using tests::run_tileflight;
using tests::TinyPlace;

class Costs : public ::testing::Test {
 protected:
  Costs() { TinyPlace::write(folder_ / "place"); }

  ProgramResult extract(const std::vector<std::string>& more) const {
    std::vector<std::string> call{"extract", (folder_ / "place").string(), "--out", (folder_ / "truth").string()};
    call.insert(call.end(), more.begin(), more.end());
    return run_tileflight(call);
  }

  tests::TemporaryFolder folder_;
};

TEST_F(Costs, AnExtractionThatDoesNotFitIsRefusedBeforeItBegins) {
  const ProgramResult whole = extract({"--memory", "0.001"});
  const ProgramResult blocks = extract({"--memory", "0.001", "--block", "auto"});
  for (const ProgramResult& refused : {whole, blocks}) {
    EXPECT_EQ(refused.exit_code, 1);
    EXPECT_EQ(tests::line_count(refused.err), 1) << refused.err;
    EXPECT_THAT(refused.err, HasSubstr("of memory, and 0.001 GB are allowed: raise the limit (--memory)"));
    EXPECT_FALSE(fs::exists(folder_ / "truth"));
  }
  EXPECT_EQ(extract({"--memory", "1"}).exit_code, 0);
  EXPECT_EQ(extract({"--force"}).exit_code, 0);
}

TEST_F(Costs, ADryRunSaysWhatItWouldTakeAndWritesNothing) {
  const ProgramResult result = extract({"--dry-run", "--json"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const json dry = json::parse(result.out);
  EXPECT_FALSE(fs::exists(folder_ / "truth"));
  EXPECT_EQ(dry["tiles_probed"], 4);
  EXPECT_EQ(dry["spread"], 0.0) << "all tiles were looked at";
  const json done = json::parse(extract({"--json"}).out);
  EXPECT_EQ(dry["estimate"]["tiles"], done["tiles_loaded"]);
  EXPECT_EQ(dry["estimate"]["bytes"].get<double>() > 0.0, true);
  EXPECT_NEAR(dry["estimate"]["triangles"].get<double>(), done["triangles"].get<double>(),
              0.01 * done["triangles"].get<double>());
  double written = 0.0;
  for (const auto& file : fs::directory_iterator(folder_ / "truth")) written += static_cast<double>(file.file_size());
  EXPECT_GT(dry["estimate"]["disk_bytes"].get<double>(), 0.6 * written);
  EXPECT_LT(dry["estimate"]["disk_bytes"].get<double>(), 1.5 * written);
  EXPECT_THAT(extract({"--dry-run"}).err, HasSubstr("exists already")) << "as without --dry-run";
}

TEST_F(Costs, AnInspectionOfVeryManyTilesetsLabelsItsEstimates) {
  json root = TinyPlace::tileset();
  root["root"].erase("content");
  json reference = root["root"]["children"][0];
  reference["content"]["uri"] = "place/tileset.json";
  reference["boundingVolume"] = root["root"]["boundingVolume"];
  root["root"]["children"] = json::array();
  for (int i = 0; i < 1100; ++i) root["root"]["children"].push_back(reference);
  TinyPlace::write_file(folder_ / "tileset.json", root.dump());
  const auto inspect = [&](const std::vector<std::string>& more) {
    std::vector<std::string> call{"inspect", (folder_ / "tileset.json").string()};
    call.insert(call.end(), more.begin(), more.end());
    const ProgramResult result = run_tileflight(call);
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return result.out;
  };
  const json some = json::parse(inspect({"--json"})), all = json::parse(inspect({"--json", "--all"}));
  EXPECT_TRUE(some["tiles"].is_null());
  EXPECT_TRUE(some["levels"].is_null());
  EXPECT_EQ(some["estimate"]["nested_files"], 1100);
  EXPECT_EQ(some["estimate"]["nested_files_not_opened"], 76);
  EXPECT_EQ(some["estimate"]["counts"]["tiles"], 1 + 1100 * 6);
  EXPECT_EQ(some["estimate"]["counts"]["content_files"], 5);
  EXPECT_EQ(all["tiles"], 1 + 1100 * 6);
  EXPECT_FALSE(all["estimate"].contains("counts"));
  EXPECT_EQ(all["estimate"]["nested_files_not_opened"], 0);
  EXPECT_EQ(all["estimate"]["extract"]["tiles"], 4400);
  EXPECT_THAT(inspect({}), HasSubstr("76 of 1100 external tilesets and subtrees were not opened"));
  EXPECT_THAT(inspect({"--all"}), Not(HasSubstr("not opened")));
}

/// The estimates hold within their spread, and what fits is not refused.
TEST(CostsOfMachangara, AreNearTheTruth) {
  TILEFLIGHT_REQUIRE_TEST_DATA(place, "tilesets/machangara_photogrammetry/tileset.json");
  const tests::TemporaryFolder folder;
  const auto run = [&](const std::vector<std::string>& more) {
    std::vector<std::string> call{"extract",     place.string(), "--center-local",        "348,-130,2890", "--size",
                                  "150,150,200", "--out",        (folder / "t").string(), "--json"};
    call.insert(call.end(), more.begin(), more.end());
    return run_tileflight(call);
  };
  const ProgramResult dry_run = run({"--dry-run"}), extracted = run({"--memory", "1"});
  ASSERT_EQ(dry_run.exit_code, 0) << dry_run.err;
  ASSERT_EQ(extracted.exit_code, 0) << extracted.err;
  const json dry = json::parse(dry_run.out), done = json::parse(extracted.out);
  EXPECT_EQ(dry["estimate"]["tiles"], done["tiles_loaded"]);
  const double triangles = done["triangles"].get<double>(), spread = dry["spread"].get<double>();
  EXPECT_NEAR(dry["estimate"]["triangles"].get<double>(), triangles,
              (0.02 + 1.5 * spread) * triangles);  // it is rounded
  EXPECT_LT(spread, 0.8);
  EXPECT_EQ(run({"--memory", "0.02", "--force"}).exit_code, 1);
}

}  // namespace
}  // namespace tileflight::costs_test
