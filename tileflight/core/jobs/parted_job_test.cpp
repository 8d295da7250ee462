#include "tileflight/core/jobs/parted_job.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>

#include "tests/refusal.h"
#include "tests/run_program.h"
#include "tests/temporary_folder.h"

namespace tileflight::jobs::parted_job_test {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::UnorderedElementsAre;
using tests::file_text;
using tests::refusal_of;

/// Stands in for tileflight: a part leaves a file in the build folder, unless it finds `stop`; the last call joins
/// them.
constexpr const char* kProgram = R"sh(#!/bin/sh
set -e
cd "$(dirname "$0")"
echo "$*" >> calls
case "$*" in
  *part*) [ ! -e stop ] || { echo "disk is full" >&2; exit 1; }
    mkdir -p build; echo "$2" > "build/$2" ;;
  *) cat build/* > out; rm -r build; echo '{"parts": 3}' ;;
esac
)sh";

class PartedJobs : public ::testing::Test {
 protected:
  void SetUp() override {
    std::ofstream(folder_ / "tileflight") << kProgram;
    fs::permissions(folder_ / "tileflight", fs::perms::owner_all);
    setenv("TILEFLIGHT", (folder_ / "tileflight").c_str(), 1);
  }
  void TearDown() override { unsetenv("TILEFLIGHT"); }

  PartedJob job(const std::string& inputs = "0123456789abcdef0123") const {
    PartedJob job{.output = folder_ / "out",
                  .build_folder = folder_ / "build",
                  .command = "extract",
                  .parts = {},
                  .last = {"join", {"join all"}},
                  .inputs_sha256 = inputs};
    for (const std::string k : {"1", "2", "3"}) job.parts.push_back({"part-" + k, {"part", k}});
    return job;
  }
  json run(const PartedJob& job, bool use_snakemake = false) const {
    return run_parted_job(job, {.jobs = 2, .cores = 2, .use_snakemake = use_snakemake});
  }
  void stop_at_the_third() const {
    std::string program(kProgram);
    const std::string condition = "[ ! -e stop ]";
    program.replace(program.find(condition), condition.size(), "[ ! -e stop -o \"$2\" != 3 ]");
    std::ofstream(folder_ / "tileflight") << program;
    std::ofstream(folder_ / "stop") << "";
  }
  std::vector<std::string> calls() {
    std::vector<std::string> lines;
    std::ifstream file(folder_ / "calls");
    for (std::string line; std::getline(file, line);) lines.push_back(line);
    fs::remove(folder_ / "calls");
    return lines;
  }

  tests::TemporaryFolder folder_;
};

TEST_F(PartedJobs, MakePartsAndThenTheOutput) {
  EXPECT_EQ(run(job())["parts"], 3);
  EXPECT_THAT(calls(), ElementsAre("part 1 --threads 1 --quiet", "part 2 --threads 1 --quiet",
                                   "part 3 --threads 1 --quiet", "join all --threads 1 --json"));
  EXPECT_EQ(file_text(folder_ / "out"), "1\n2\n3\n");
  EXPECT_FALSE(fs::exists(tasks_folder_of(folder_ / "out")));
}

TEST_F(PartedJobs, GoOnWhereTheyStopped) {
  std::ofstream(folder_ / "stop") << "";
  EXPECT_THAT(refusal_of([&] { run(job()); }),
              ::testing::AllOf(HasSubstr("task part-1: failed: disk is full"), HasSubstr("the same command goes on")));
  calls();
  fs::remove(folder_ / "stop");
  EXPECT_EQ(run(job())["parts"], 3);
  EXPECT_EQ(calls().size(), 4U);
}

TEST_F(PartedJobs, DoAgainWhatOtherInputsGaveOrWhatIsGone) {
  // Parts 1 and 2 are done, the third is not.
  stop_at_the_third();
  EXPECT_THAT(refusal_of([&] { run(job()); }), HasSubstr("task part-3"));
  EXPECT_THAT(calls(), UnorderedElementsAre(HasSubstr("part 1"), HasSubstr("part 2"), HasSubstr("part 3")));
  fs::remove(folder_ / "stop");
  EXPECT_EQ(run(job("another"))["parts"], 3);
  EXPECT_EQ(calls().size(), 4U) << "from other inputs";
  std::ofstream(folder_ / "stop") << "";
  EXPECT_THAT(refusal_of([&] { run(job()); }), HasSubstr("task part-3"));
  calls();
  fs::remove_all(folder_ / "build");
  fs::remove(folder_ / "stop");
  EXPECT_EQ(run(job())["parts"], 3);
  EXPECT_EQ(calls().size(), 4U) << "what was made is gone";
}

TEST_F(PartedJobs, TakeUpOnlyWhatIsMissing) {
  stop_at_the_third();
  EXPECT_THAT(refusal_of([&] { run(job()); }), HasSubstr("task part-3"));
  calls();
  fs::remove(folder_ / "stop");
  EXPECT_EQ(run(job())["parts"], 3);
  EXPECT_THAT(calls(), ElementsAre("part 3 --threads 1 --quiet", "join all --threads 1 --json"));
}

TEST_F(PartedJobs, AreTheSameThroughSnakemake) {
  if (std::system("command -v snakemake > /dev/null") != 0) GTEST_SKIP() << "snakemake is not installed";
  EXPECT_EQ(run(job(), true)["parts"], 3);
  EXPECT_EQ(file_text(folder_ / "out"), "1\n2\n3\n");
  EXPECT_EQ(calls().size(), 4U);
}

TEST(WithoutOptions, LeavesOutFlagsAndOptionsWithTheirValues) {
  EXPECT_THAT(
      without_options({"extract", "place", "--jobs", "2", "--block=30", "--json", "--out", "--jobs2", "--blocks"},
                      {"--json"}, {"--jobs", "--block"}),
      ElementsAre("extract", "place", "--out", "--jobs2", "--blocks"));
}

}  // namespace
}  // namespace tileflight::jobs::parted_job_test
