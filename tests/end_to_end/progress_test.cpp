// Commands report progress: one rewritten line on a terminal, a line for each stage in a file.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <pty.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <nlohmann/json.hpp>
#include <regex>

#include "tests/run_program.h"
#include "tests/tiny_experiments.h"

namespace tileflight::progress_test {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;
using tests::ProgramResult;
using tests::run_tileflight;
using tests::TinyPlace;

/// Returns the text that the program writes to its terminal.
std::string on_terminal(const std::vector<std::string>& arguments) {
  int terminal = -1;
  winsize size{.ws_row = 24, .ws_col = 60, .ws_xpixel = 0, .ws_ypixel = 0};
  const pid_t process = ::forkpty(&terminal, nullptr, nullptr, &size);
  if (process == 0) {
    std::vector<char*> words{const_cast<char*>(TILEFLIGHT_BINARY)};
    for (const std::string& argument : arguments) words.push_back(const_cast<char*>(argument.c_str()));
    words.push_back(nullptr);
    ::execv(words[0], words.data());
    ::_exit(127);
  }
  std::string text;
  std::array<char, 4096> block{};
  for (ssize_t n = 0; (n = ::read(terminal, block.data(), block.size())) > 0;)
    text.append(block.data(), static_cast<std::size_t>(n));
  ::close(terminal);
  ::waitpid(process, nullptr, 0);
  return text;
}

class Progress : public ::testing::Test {
 protected:
  Progress() {
    TinyPlace::write(folder_ / "place");
    TinyPlace::write_file(folder_ / "camera.yaml", TinyPlace::kCamera);
    TinyPlace::write_file(folder_ / "flight.yaml", R"(camera: camera.yaml
fps: 10
speed_m_s: 4
max_frames: 30
waypoints:
  - {position: [-18, -12, 116], yaw_deg: 55, pitch_deg: -45}
  - {position: [18, 10, 116], yaw_deg: 70, pitch_deg: -45}
)");
  }
  std::string path(const std::string& name) const { return (folder_ / name).string(); }
  std::vector<std::string> render(const std::string& out) const {
    return {"render", path("place"), "--flight", path("flight.yaml"), "--out", path(out)};
  }

  tests::TemporaryFolder folder_;
};

/// Each line: a stage, a colon, and how long it took.
void expect_stage_lines(const std::string& text) {
  const std::regex line("[a-z/ ]+: ([0-9.]+ (s|min|h)( [0-9]+ (s|min))?|unchanged, skipped)");
  std::istringstream lines(text);
  for (std::string one; std::getline(lines, one);) EXPECT_TRUE(std::regex_match(one, line)) << one;
}

TEST_F(Progress, InAFileEachStageHasALine) {
  const ProgramResult result = run_tileflight(render("a"));
  ASSERT_EQ(result.exit_code, 0);
  EXPECT_THAT(result.err, HasSubstr("frames rendered: "));
  expect_stage_lines(result.err);
  EXPECT_THAT(result.err, Not(HasSubstr("\r")));

  std::vector<std::string> quiet = render("b");
  quiet.emplace_back("--quiet");
  EXPECT_EQ(run_tileflight(quiet).err, "");
  std::vector<std::string> json = render("c");
  json.emplace_back("--json");
  const ProgramResult object = run_tileflight(json);
  EXPECT_TRUE(nlohmann::json::accept(object.out)) << "and nothing else";
  expect_stage_lines(object.err);
}

TEST_F(Progress, AFailureAtOnceIsOneLine) {
  std::vector<std::string> call = render("a");
  std::filesystem::remove(folder_ / "place/2.glb");
  const ProgramResult result = run_tileflight(call);
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_EQ(tests::line_count(result.err), 1) << result.err;
}

TEST_F(Progress, OfARunStagesHaveTheirNames) {
  tests::TinyExperiments::one_flight().copy_to(folder_ / "run");
  const std::string first = tests::file_text(folder_ / "run/progress.txt");
  expect_stage_lines(first);
  for (const char* stage : {"truth: ", "simulated/dataset: ", "simulated/odometry: ", "simulated/alignment: ",
                            "simulated/evaluation: ", "report: "})
    EXPECT_THAT(first, HasSubstr(stage));
  EXPECT_THAT(first, Not(HasSubstr("place: "))) << "there is no built-in place in it";
  const ProgramResult second = run_tileflight({"run", path("run/experiment.yaml"), "--out", path("run/out")});
  expect_stage_lines(second.err);
  EXPECT_EQ(tests::line_count(second.err), tests::line_count(first));
  EXPECT_THAT(second.err, HasSubstr("simulated/dataset: unchanged, skipped\n"));
}

TEST_F(Progress, OnATerminalOneLineIsRewritten) {
  const std::string rendered = on_terminal(render("a"));
  EXPECT_THAT(rendered, HasSubstr("\r\033[Kframes rendered"));
  EXPECT_THAT(rendered, HasSubstr(" %"));
  EXPECT_THAT(rendered, HasSubstr("30 frames"));
  tests::TinyExperiments::one_flight().copy_to(folder_ / "run");
  std::filesystem::remove(folder_ / "run/out/stages/simulated-dataset.json");  // rendered again
  const std::string run = on_terminal({"run", path("run/experiment.yaml"), "--out", path("run/out")});
  EXPECT_THAT(run, HasSubstr("\r\033[Ksimulated/dataset: frames rendered"));
  EXPECT_THAT(run, HasSubstr("truth: "));
  const std::regex too_long("\r\033\\[K[^\r\n]{60}");
  EXPECT_FALSE(std::regex_search(run, too_long)) << "a line that wraps cannot be rewritten";
  EXPECT_EQ(on_terminal({"inspect", path("place"), "--quiet"}), "");
}

}  // namespace
}  // namespace tileflight::progress_test
