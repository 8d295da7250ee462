// `tileflight completion`: what a shell with the script completes.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/run_program.h"

namespace tileflight::completion_test {
namespace {

namespace fs = std::filesystem;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsSupersetOf;
using ::testing::Not;
using tests::ProgramResult;
using tests::run_tileflight;

std::vector<std::string> lines_of(const std::string& text) {
  std::istringstream stream(text);
  std::vector<std::string> lines;
  for (std::string line; std::getline(stream, line);) lines.push_back(line);
  return lines;
}

class Completion : public testing::Test {
 protected:
  void SetUp() override {
    for (const char* shell : {"bash", "zsh"}) {
      const ProgramResult script = run_tileflight({"completion", shell});
      ASSERT_EQ(script.exit_code, 0) << script.err;
      std::ofstream(folder_ / shell) << script.out;
    }
    fs::create_directories(folder_ / "work");
    std::ofstream(folder_ / "work/flight.yaml") << "";
    std::ofstream(folder_ / "work/video one.mp4") << "";
  }

  /// Returns the words that bash offers for the last word, in a folder with flight.yaml and "video one.mp4".
  std::vector<std::string> bash_offers(const std::vector<std::string>& words) const {
    std::string array;
    for (const std::string& word : words) array += tests::shell_quoted(word) + " ";
    const std::string script = "cd " + tests::shell_quoted((folder_ / "work").string()) +
                               " && source ../bash && COMP_WORDS=(" + array +
                               ") COMP_CWORD=" + std::to_string(words.size() - 1) +
                               " && _tileflight && [ ${#COMPREPLY[@]} -eq 0 ] || printf '%s\\n' \"${COMPREPLY[@]}\"";
    return lines_of(tests::run_command({"bash", "--noprofile", "--norc", "-c", script}).out);
  }

  tests::TemporaryFolder folder_;
};

TEST_F(Completion, BashOffersTheCommands) {
  EXPECT_THAT(bash_offers({"tileflight", ""}), IsSupersetOf({"render", "odometry", "scene", "completion"}));
  EXPECT_THAT(bash_offers({"tileflight", "re"}), ElementsAre("render", "report"));
  EXPECT_THAT(bash_offers({"tileflight", "scene", ""}), IsSupersetOf({"stadium", "town"}));
}

TEST_F(Completion, BashOffersTheOptionsOfTheCommandAndNoOthers) {
  const std::vector<std::string> options = bash_offers({"tileflight", "render", "tiles", "--"});
  EXPECT_THAT(options, IsSupersetOf({"--flight", "--out", "--threads", "--json"}));
  EXPECT_THAT(options, Not(Contains("--layout"))) << "an option of export";
  EXPECT_THAT(bash_offers({"tileflight", "render", "tiles", "--fl"}), ElementsAre("--flight"));
  EXPECT_THAT(bash_offers({"tileflight", "scene", "stadium", "--se"}), ElementsAre("--seed"));
}

TEST_F(Completion, BashOffersTheWordsOfAnOptionWithAndWithoutAnEqualsSign) {
  EXPECT_THAT(bash_offers({"tileflight", "export", "dataset", "--layout", "e"}), ElementsAre("euroc"));
  EXPECT_THAT(bash_offers({"tileflight", "export", "dataset", "--layout", "=", "k"}), ElementsAre("kitti"));
  EXPECT_THAT(bash_offers({"tileflight", "export", "dataset", "--layout", "="}), Contains("colmap"));
  EXPECT_THAT(bash_offers({"tileflight", "completion", ""}), ElementsAre("bash", "zsh"));
}

TEST_F(Completion, BashOffersFilesWhereAFileMayStandAndNothingForANumber) {
  EXPECT_THAT(bash_offers({"tileflight", "render", "tiles", "--flight", "fl"}), ElementsAre("flight.yaml"));
  EXPECT_THAT(bash_offers({"tileflight", "ingest", "vid"}), ElementsAre("video one.mp4"));
  EXPECT_THAT(bash_offers({"tileflight", "render", "--quiet", "fl"}), ElementsAre("flight.yaml")) << "after a flag";
  EXPECT_THAT(bash_offers({"tileflight", "render", "--threads", ""}), ElementsAre()) << "a number";
}

TEST_F(Completion, ZshReadsTheScriptAndOffersTheSame) {
  if (tests::run_command({"zsh", "--version"}).exit_code != 0) GTEST_SKIP() << "no zsh here";
  // A shell in a terminal of its own, for zsh completes nothing else.
  const std::string driver = R"(
zmodload zsh/zpty
zpty shell zsh -f -i
offers() {
  zpty -w -n shell "$1"$'\t'
  local text all= n=0
  while (( n++ < 100 )); do
    if zpty -r -t shell text; then all+=$text; else sleep 0.02; fi
    [[ $all == *$2* ]] && break
  done
  print -r -- ${all//[[:cntrl:]]/ }
  zpty -w -n shell $'\x15'
}
zpty -w shell 'PS1="> "; autoload -U compinit; compinit -u -D; source ../zsh; print ready'
local text; zpty -r shell text '*ready*ready*'
offers 'tileflight ren' 'render'
offers 'tileflight export --lay' 'layout'
offers 'tileflight export --layout=eu' 'euroc'
offers 'tileflight scene sta' 'stadium'
)";
  std::ofstream(folder_ / "driver") << driver;
  const std::string script = "cd " + tests::shell_quoted((folder_ / "work").string()) + " && zsh -f ../driver";
  const ProgramResult result = tests::run_command({"sh", "-c", script});
  for (const char* completed : {"render", "--layout", "euroc", "stadium"})
    EXPECT_THAT(result.out, HasSubstr(completed)) << result.err;
}

}  // namespace
}  // namespace tileflight::completion_test
