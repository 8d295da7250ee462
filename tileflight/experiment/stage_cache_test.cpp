#include "tileflight/experiment/stage_cache.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <fstream>

#include "tests/temporary_folder.h"
#include "tileflight/base/files.h"
#include "tileflight/base/input_error.h"

namespace tileflight::experiment::stage_cache_test {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

class Stages : public ::testing::Test {
 protected:
  StageCache cache(const std::string& program = "program") {
    return {folder_ / "run", program, {}, [this](const StageEvent& news) {
              news_.push_back(news.stage + (news.kind == StageEvent::Kind::kBegins ? " begins"
                                            : news.kind == StageEvent::Kind::kDone ? " done"
                                                                                   : " unchanged"));
            }};
  }
  /// Runs a stage that writes one file, "made of INPUT".
  bool once(StageCache& in, const std::string& input, const std::string& name = "a/b") {
    return in.run_stage(name, {{"input", input}}, {"product"},
                        [&] { base::write_file(folder_ / "run/product", "made of " + input); });
  }
  std::string product() const { return base::read_text(folder_ / "run/product"); }

  tests::TemporaryFolder folder_;
  std::vector<std::string> news_;
};

TEST_F(Stages, AreDoneOnceForTheSameInputs) {
  {
    StageCache first = cache();
    EXPECT_FALSE(first.is_done("a/b"));
    EXPECT_TRUE(once(first, "x"));
    EXPECT_TRUE(first.is_done("a/b"));
    EXPECT_EQ(first.seconds().count("a/b"), 1U);
  }
  StageCache second = cache();
  EXPECT_FALSE(second.is_done("a/b")) << "until it is asked for";
  EXPECT_FALSE(once(second, "x"));
  EXPECT_TRUE(second.is_done("a/b"));
  EXPECT_THAT(news_, ElementsAre("a/b begins", "a/b done", "a/b unchanged"));
}

TEST_F(Stages, AreDoneAgainForOthersForAnotherProgramAndForLostProducts) {
  StageCache stages = cache();
  once(stages, "x");
  const std::string key = stages.key("a/b");
  EXPECT_TRUE(once(stages, "y"));
  EXPECT_NE(stages.key("a/b"), key);
  EXPECT_EQ(product(), "made of y");
  EXPECT_TRUE(once(stages, "x"));
  EXPECT_EQ(stages.key("a/b"), key);
  StageCache other = cache("another program");
  EXPECT_TRUE(once(other, "x"));
  EXPECT_FALSE(once(other, "x"));
  fs::remove(folder_ / "run/product");
  EXPECT_TRUE(once(other, "x"));
}

TEST_F(Stages, ThatFailAreNotDoneAndLeaveWhatWasThere) {
  StageCache stages = cache();
  once(stages, "x");
  EXPECT_THAT(
      [&] {
        stages.run_stage("a/b", {{"input", "y"}}, {"product"}, [] { throw InputError("disk", "is full"); });
      },
      ThrowsMessage<InputError>(HasSubstr("disk: is full")));
  EXPECT_EQ(product(), "made of x");
  StageCache next = cache();
  EXPECT_TRUE(once(next, "x")) << "what is there may be half replaced";
}

TEST_F(Stages, RecordsOfRubbishAreNone) {
  const fs::path record = folder_ / "run/stages/a-b.json";
  for (const char* text : {"", "{", "[]", "null", "{\"key\": 7}", "{\"key\": null, \"seconds\": \"x\"}"}) {
    StageCache stages = cache();
    once(stages, "x");
    std::ofstream(record) << text;
    EXPECT_TRUE(once(stages, "x")) << text;
  }
}

TEST_F(Stages, AreForgottenWithThoseOfVariantsAndTheirProductsStay) {
  StageCache stages = cache();
  once(stages, "x");
  StageCache variant(folder_ / "run/variants/v", "program");
  variant.run_stage("c", {}, {}, [] {});
  std::ofstream(folder_ / "run/stages/notes.txt") << "mine";
  invalidate_stages(folder_ / "run");
  EXPECT_EQ(product(), "made of x");
  EXPECT_TRUE(fs::exists(folder_ / "run/stages/notes.txt"));
  StageCache next = cache();
  EXPECT_TRUE(once(next, "x"));
  EXPECT_TRUE(StageCache(folder_ / "run/variants/v", "program").run_stage("c", {}, {}, [] {}));
}

TEST_F(Stages, ContentDecides) {
  StageCache stages = cache();
  std::ofstream(folder_ / "input") << "one";
  const std::string before = stages.content_hash(folder_ / "input");
  fs::last_write_time(folder_ / "input", fs::file_time_type::clock::now() - std::chrono::hours(1));
  EXPECT_EQ(stages.content_hash(folder_ / "input"), before);
  std::ofstream(folder_ / "input") << "two";
  EXPECT_NE(stages.content_hash(folder_ / "input"), before);
  const std::string all = stages.content_hash(folder_.path());
  std::ofstream(folder_ / "run/results.json") << "a result";
  EXPECT_EQ(stages.content_hash(folder_.path()), all) << "the run folder is no input of its own";
}

}  // namespace
}  // namespace tileflight::experiment::stage_cache_test
