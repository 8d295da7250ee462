#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

#include "tests/run_program.h"
#include "tileflight/tiles/tileset/test_http_tileset.h"

/// The binary against a server on the loopback device: what a user sees, and what is left on disk.
namespace tileflight::network_test {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using tests::run_tileflight;

class Network : public ::testing::Test {
 protected:
  Network() { place_.add_tileset(); }

  std::string out(const std::string& name) const { return (folder_ / name).string(); }
  std::string environment() const { return "XDG_CACHE_HOME=" + tests::shell_quoted((folder_ / "cache").string()); }
  std::vector<std::string> extract(const std::string& source, const std::string& name) const {
    return {"extract", source, "--out", out(name), "--json"};
  }
  std::string everything_written() const {
    std::string bytes;
    for (const auto& entry : fs::recursive_directory_iterator(folder_.path())) {
      if (entry.is_regular_file()) bytes += tests::file_text(entry.path());
    }
    return bytes;
  }

  tests::TemporaryFolder folder_;
  tileset::test_support::TestHttpTileset place_;
};

TEST_F(Network, ATilesetBehindAKeyIsExtractedAndTheKeyIsNowhere) {
  const std::string source = place_.root() + "?key=SECRETSECRET";
  const auto result = run_tileflight(extract(source, "truth"), environment());
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const nlohmann::json json = nlohmann::json::parse(result.out);
  EXPECT_EQ(json["tiles_loaded"], 2);
  EXPECT_TRUE(json["complete"]);
  EXPECT_EQ(json["source"], place_.root() + "?key=…");
  EXPECT_EQ(json["terms_accepted"], false);
  EXPECT_EQ(json["terms"]["provider"], "127.0.0.1");
  EXPECT_EQ(json["attribution"], nlohmann::json({"City", "Survey"}));
  EXPECT_THAT(everything_written() + result.out + result.err, Not(HasSubstr("SECRETSECRET")));
  EXPECT_TRUE(fs::exists(folder_ / "cache" / "tileflight" / "http-1.sqlite"));

  const auto inspected = run_tileflight({"inspect", source, "--no-cache"}, environment());
  EXPECT_EQ(inspected.exit_code, 0) << inspected.err;
  EXPECT_THAT(inspected.out, AllOf(HasSubstr("2 files)"), Not(HasSubstr("SECRET"))));
}

TEST_F(Network, AMissingPlaceIsOneLineWithoutTheKey) {
  const auto result = run_tileflight(extract(place_.url("/none.json?key=SECRETSECRET"), "truth"), environment());
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_EQ(tests::line_count(result.err), 1) << result.err;
  EXPECT_THAT(result.err,
              AllOf(HasSubstr("/none.json: the server answered with status 404"), Not(HasSubstr("SECRET"))));
  EXPECT_FALSE(fs::exists(folder_ / "truth"));
}

TEST_F(Network, WhatGooglesTermsForbidIsRefusedBeforeAnythingIsAsked) {
  const std::string key = environment() + " GOOGLE_MAPS_API_KEY=SECRETSECRET";
  const auto extracted = run_tileflight(extract("google", "truth"), key);
  EXPECT_EQ(extracted.exit_code, 1);
  EXPECT_THAT(extracted.err, AllOf(HasSubstr("forbid extraction of geometry"),
                                   HasSubstr("https://developers.google.com/maps/documentation/tile/policies"),
                                   HasSubstr("--terms-accepted"), Not(HasSubstr("SECRET"))));
  EXPECT_EQ(tests::line_count(extracted.err), 1);
  const auto keyless = run_tileflight({"inspect", "google"}, environment() + " GOOGLE_MAPS_API_KEY=");
  EXPECT_EQ(keyless.exit_code, 1);
  EXPECT_THAT(keyless.err, HasSubstr("GOOGLE_MAPS_API_KEY"));
  const auto tokenless = run_tileflight({"inspect", "ion:5"}, environment() + " CESIUM_ION_TOKEN=");
  EXPECT_THAT(tokenless.err, HasSubstr("CESIUM_ION_TOKEN"));
}

TEST_F(Network, ACacheThatIsAskedForButCannotBeMadeIsAnError) {
  std::vector<std::string> arguments = extract(place_.root(), "truth");
  arguments.insert(arguments.end(), {"--cache", "/dev/null/cache"});
  const auto result = run_tileflight(arguments, environment());
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.err, HasSubstr("/dev/null/cache: the cache folder cannot be created"));
  const auto without = run_tileflight(extract(place_.root(), "truth"), "XDG_CACHE_HOME=/dev/null/cache");
  EXPECT_EQ(without.exit_code, 0) << "one that nobody asked for is not worth a failure: " << without.err;
}

}  // namespace
}  // namespace tileflight::network_test
