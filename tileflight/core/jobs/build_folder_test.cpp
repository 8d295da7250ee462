#include "tileflight/core/jobs/build_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <memory>
#include <nlohmann/json.hpp>
#include <thread>

#include "tests/refusal.h"
#include "tests/temporary_folder.h"
#include "tileflight/core/base/files.h"

namespace tileflight::jobs::build_folder_test {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using ::testing::HasSubstr;
using tests::refusal_of;

constexpr const char* kBusy = "another process is working in it";

class Build : public ::testing::Test {
 protected:
  fs::path path() const { return BuildFolder::path_beside(folder_ / "out", "kept"); }
  std::string prepare(const json& inputs, Share share = Share::kWhole) const {
    return BuildFolder::prepare(path(), inputs, share, {"made"});
  }

  tests::TemporaryFolder folder_;
};

TEST_F(Build, KeepsWhatIsMadeFromTheSameInputsAlone) {
  EXPECT_EQ(prepare({{"seed", 1}, {"program", "a"}}), "");
  base::write_file(path() / "made/one", "1");
  EXPECT_EQ(prepare({{"seed", 1}, {"program", "a"}}), "");
  EXPECT_TRUE(fs::exists(path() / "made/one"));
  EXPECT_EQ(prepare({{"seed", 1}, {"program", "b"}}), "because these inputs differ: program");
  EXPECT_FALSE(fs::exists(path() / "made/one"));
  BuildFolder(path(), "0", Share::kWhole).remove();
  EXPECT_FALSE(fs::exists(path()));
}

TEST_F(Build, AWholeJobIsAloneAndPartsAreBesideParts) {
  prepare({{"seed", 1}});
  {
    const BuildFolder whole(path(), "0", Share::kWhole), second_rank(path(), "1", Share::kWhole);
    EXPECT_THAT(refusal_of([&] { prepare({{"seed", 1}}); }), HasSubstr(kBusy));
    EXPECT_THAT(refusal_of([&] { prepare({{"seed", 1}}, Share::kPart); }), HasSubstr(kBusy));
    EXPECT_THAT(refusal_of([&] { BuildFolder(path(), "1", Share::kWhole); }), HasSubstr(kBusy));
  }
  prepare({{"seed", 1}}, Share::kPart);
  const BuildFolder part(path(), "1", Share::kPart);
  EXPECT_EQ(prepare({{"seed", 1}}, Share::kPart), "");
  const BuildFolder other(path(), "2", Share::kPart);
  EXPECT_THAT(refusal_of([&] { prepare({{"seed", 1}}); }), HasSubstr(kBusy));
  EXPECT_THAT(refusal_of([&] { prepare({{"seed", 2}}, Share::kPart); }), HasSubstr(kBusy));
}

TEST_F(Build, APartWaitsForOneOfTheSameName) {
  prepare({});
  auto earlier = std::make_unique<BuildFolder>(path(), "1", Share::kPart);
  std::atomic<bool> entered = false;
  std::thread later([&] {
    const BuildFolder part(path(), "1", Share::kPart);
    entered = true;
  });
  std::this_thread::sleep_for(std::chrono::milliseconds(50));
  EXPECT_FALSE(entered);
  earlier.reset();
  later.join();
  EXPECT_TRUE(entered);
}

TEST_F(Build, ALockOfAKilledProcessDoesNotCount) {
  prepare({{"seed", 1}});
  const pid_t child = fork();
  if (child == 0) {
    const BuildFolder first(path(), "0", Share::kWhole);
    base::write_file(folder_ / "entered", "");
    ::pause();
    _exit(0);
  }
  while (!fs::exists(folder_ / "entered")) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  {
    const BuildFolder second(path(), "1", Share::kWhole);
    EXPECT_THAT(refusal_of([&] { prepare({{"seed", 1}}); }), HasSubstr(kBusy));
    ::kill(child, SIGKILL);
    ::waitpid(child, nullptr, 0);
  }
  EXPECT_EQ(prepare({{"seed", 1}}), "");
}

}  // namespace
}  // namespace tileflight::jobs::build_folder_test
