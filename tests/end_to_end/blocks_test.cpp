// `extract --block` by several processes: parts and tasks; killed, refused, and gone on with.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <nlohmann/json.hpp>
#include <thread>

#include "tests/run_program.h"
#include "tests/same_files.h"
#include "tests/tiny_place.h"

namespace tileflight::blocks_test {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using ::testing::HasSubstr;
using tests::file_text;
using tests::ProgramResult;
using tests::run_tileflight;
using tests::TinyPlace;

class Blocks : public ::testing::Test {
 protected:
  Blocks() { TinyPlace::write(folder_ / "place"); }

  /// 25 blocks of 16 m on cells of 0.5 m.
  std::vector<std::string> call(const std::string& out, const std::vector<std::string>& more = {}) const {
    std::vector<std::string> words{"extract", (folder_ / "place").string(), "--voxel", "0.5", "--block", "16",
                                   "--out",   (folder_ / out).string(),     "--json"};
    words.insert(words.end(), more.begin(), more.end());
    return words;
  }
  json extract(const std::string& out, const std::vector<std::string>& more = {}) const {
    const ProgramResult result = run_tileflight(call(out, more));
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return result.exit_code == 0 ? json::parse(result.out) : json();
  }
  void expect_same(const std::string& one, const std::string& other) const {
    tests::expect_same_files(folder_ / one, folder_ / other, "extract.json");
    EXPECT_EQ(without_seconds(one), without_seconds(other));
    for (const char* kind : {"blocks", "tasks"}) EXPECT_FALSE(fs::exists(kept(other, kind)));
  }
  json without_seconds(const std::string& out) const {
    json extract = json::parse(file_text(folder_ / out / "extract.json"));
    extract.erase("seconds");
    return extract;
  }
  fs::path kept(const std::string& out, const std::string& kind = "blocks") const {
    return folder_ / ("." + out + "." + kind);
  }
  std::size_t blocks_in(const fs::path& store) const {
    std::error_code error;
    std::size_t count = 0;
    for (fs::directory_iterator entry(store / "done", error), end; !error && entry != end; entry.increment(error))
      count += entry->path().extension() == ".json" ? 1 : 0;
    return count;
  }
  /// A tile whose content reaches far beyond its bounding volume.
  void understate_a_volume() const {
    json tileset = TinyPlace::tileset();
    tileset["root"]["children"][3]["boundingVolume"]["box"] = {35, 35, 100, 4, 0, 0, 0, 4, 0, 0, 0, 4};
    TinyPlace::write_file(folder_ / "place/tileset.json", tileset.dump());
  }

  tests::TemporaryFolder folder_;
};

TEST_F(Blocks, AreTheSameInParts) {
  understate_a_volume();
  extract("alone");
  for (const std::string k : {"3", "1", "2"}) {
    const json part = extract("parts", {"--part", k + "/3"});
    EXPECT_EQ(part["build"]["blocks"], 25);
    EXPECT_GE(part["build"]["blocks_made"], 5);
  }
  EXPECT_EQ(extract("parts", {"--part", "1/3"})["build"]["blocks_made"], 0);
  EXPECT_FALSE(fs::exists(folder_ / "parts"));
  EXPECT_EQ(blocks_in(kept("parts")), 25U);
  EXPECT_EQ(extract("parts", {"--resume"})["build"]["blocks_reused"], 25);
  expect_same("alone", "parts");
  run_tileflight({"extract", (folder_ / "place").string(), "--voxel", "0.5", "--out", (folder_ / "whole").string()});
  EXPECT_EQ(without_seconds("whole"), without_seconds("parts"));
}

TEST_F(Blocks, GoOnAfterAFullDisk) {
  extract("alone");
  const ProgramResult full = run_tileflight(call("out", {"--resume"}), "ulimit -f 40; ");
  EXPECT_EQ(full.exit_code, 1);
  EXPECT_EQ(tests::line_count(full.err), 1) << full.err;
  EXPECT_FALSE(fs::exists(folder_ / "out"));
  extract("out");
  expect_same("alone", "out");
  const ProgramResult forgotten = run_tileflight(call("other"), "ulimit -f 40; ");
  EXPECT_EQ(forgotten.exit_code, 1);
  EXPECT_FALSE(fs::exists(kept("other"))) << "nothing is kept unless it was asked for";
}

TEST_F(Blocks, BadOptionsAreOneLine) {
  const auto fault = [&](const std::vector<std::string>& more) { return run_tileflight(call("out", more)); };
  for (const std::string part : {"0/2", "3/2", "1", "1/", "a/b", "1/2/3"}) {
    const ProgramResult result = fault({"--part", part});
    EXPECT_EQ(result.exit_code, 2) << part;
    EXPECT_THAT(result.err, HasSubstr("must be two numbers from 1, as in 2/8"));
  }
  EXPECT_EQ(fault({"--part", "1/2", "--jobs", "2"}).exit_code, 2);
  EXPECT_EQ(run_tileflight({"extract", "x", "--out", "y", "--resume"}).exit_code, 2);
  EXPECT_EQ(run_tileflight({"extract", "x", "--out", "y", "--jobs", "2"}).exit_code, 2);
}

/// Kills all that it started in the middle.
TEST_F(Blocks, AreTheSameInTasksThatWereKilled) {
  extract("alone");
  const pid_t child = fork();
  if (child == 0) {
    setpgid(0, 0);
    std::vector<std::string> words = call("out", {"--jobs", "2", "--quiet"});
    words.insert(words.begin(), TILEFLIGHT_BINARY);
    std::vector<char*> arguments;
    for (std::string& word : words) arguments.push_back(word.data());
    arguments.push_back(nullptr);
    execv(TILEFLIGHT_BINARY, arguments.data());
    _exit(127);
  }
  while (blocks_in(kept("out")) < 3 && !fs::exists(folder_ / "out"))
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  kill(-child, SIGKILL);
  waitpid(child, nullptr, 0);
  EXPECT_FALSE(fs::exists(folder_ / "out"));
  const std::size_t there = blocks_in(kept("out"));
  EXPECT_GE(there, 3U);
  // One task after the other, which needs no Snakemake.
  const json rest = extract("out", {"--jobs", "2", "--no-snakemake"});
  EXPECT_EQ(rest["build"]["blocks"], 25);
  expect_same("alone", "out");
  const ProgramResult again = run_tileflight(call("out", {"--jobs", "2"}));
  EXPECT_EQ(again.exit_code, 1);
  EXPECT_THAT(again.err, HasSubstr("exists already; --force replaces it"));
}

}  // namespace
}  // namespace tileflight::blocks_test
