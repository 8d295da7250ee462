#include "tileflight/experiments/experiment/stage_cache.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "tests/temporary_folder.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/output_folder.h"

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

TEST_F(Stages, AVariantTakesOverWhatIsEqual) {
  int works = 0;
  const auto stage = [&](StageCache& in, const std::string& input) {
    return in.run_stage("a/b", {{"input", input}}, {"a/folder"}, [&] {
      ++works;
      base::write_folder(in.run_folder() / "a/folder", true, [&](const fs::path& temporary) {
        fs::create_directories(temporary / "part");
        base::write_file(temporary / "part/file", input);
      });
    });
  };
  StageCache original = cache();
  stage(original, "x");
  once(original, "x", "c");  // its product is a file, and others may lie beside it
  const fs::path run = folder_ / "run/variants/v";
  StageCache variant(run, "program", {}, {}, folder_ / "run");
  EXPECT_FALSE(stage(variant, "x"));
  EXPECT_EQ(works, 1);
  EXPECT_TRUE(fs::equivalent(run / "a/folder/part/file", folder_ / "run/a/folder/part/file"));
  EXPECT_EQ(variant.key("a/b"), original.key("a/b"));
  EXPECT_TRUE(variant.run_stage("c", {{"input", "x"}}, {"product"}, [&] { base::write_file(run / "product", "x"); }));

  StageCache later(run, "program", {}, {}, folder_ / "run");
  EXPECT_FALSE(stage(later, "x")) << "it is the variant's own now";
  EXPECT_TRUE(stage(later, "y")) << "what differs is done";
  EXPECT_EQ(base::read_text(run / "a/folder/part/file"), "y");
  EXPECT_EQ(base::read_text(folder_ / "run/a/folder/part/file"), "x") << "the original run keeps its own";
  StageCache again(run, "program", {}, {}, folder_ / "run");
  EXPECT_FALSE(stage(again, "x")) << "and gives it again";
  EXPECT_EQ(base::read_text(run / "a/folder/part/file"), "x");
  fs::remove_all(folder_ / "run/a");
  StageCache alone(run, "other program", {}, {}, folder_ / "run");
  EXPECT_TRUE(stage(alone, "x"));
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
