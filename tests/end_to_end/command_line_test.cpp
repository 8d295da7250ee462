// The outside of the program: help, exit codes, one line of error, JSON alone on stdout.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "tests/run_program.h"

namespace tileflight::command_line_test {
namespace {

using ::testing::ContainsRegex;
using ::testing::HasSubstr;
using tests::ProgramResult;
using tests::run_tileflight;

const std::vector<std::vector<std::string>> kCommands{
    {"scene", "stadium"}, {"tile"},     {"inspect"}, {"extract"},  {"preview"}, {"render"},   {"lens"}, {"ingest"},
    {"export"},           {"odometry"}, {"align"},   {"evaluate"}, {"compare"}, {"localize"}, {"new"},  {"run"},
    {"report"},           {"serve"},    {"play"}};

TEST(CommandLine, EveryCommandHasHelpWithAnExample) {
  for (std::vector<std::string> command : kCommands) {
    command.push_back("--help");
    const ProgramResult result = run_tileflight(command);
    EXPECT_EQ(result.exit_code, 0) << command[0];
    EXPECT_THAT(result.out, HasSubstr("Example")) << command[0];
    EXPECT_THAT(result.out, HasSubstr("tileflight " + command[0])) << command[0];
    for (const char* option : {"--json", "--quiet", "--threads", "--force"}) EXPECT_THAT(result.out, HasSubstr(option));
  }
}

TEST(CommandLine, WrongUsageIsExitCodeTwo) {
  EXPECT_EQ(run_tileflight({}).exit_code, 2);
  EXPECT_EQ(run_tileflight({"fly"}).exit_code, 2);
  EXPECT_EQ(run_tileflight({"extract"}).exit_code, 2);
  EXPECT_EQ(run_tileflight({"extract", "a", "--out", "b", "--voxel", "-1"}).exit_code, 2);
  EXPECT_EQ(run_tileflight({"run", "a.yaml", "--out", "b", "--threads", "0"}).exit_code, 2);
}

TEST(CommandLine, AMisspeltWordIsNamedWithTheNearest) {
  const auto says = [](const std::vector<std::string>& call, const std::string& text) {
    const ProgramResult result = run_tileflight(call);
    EXPECT_EQ(result.exit_code, 2) << call[0];
    EXPECT_EQ(tests::line_count(result.err), 1) << result.err;
    EXPECT_EQ(result.out, "") << call[0];
    EXPECT_THAT(result.err, HasSubstr(text));
  };
  says({"rnder", "x"}, "unknown command 'rnder'; did you mean 'render'?");
  says({"photogrammetry"}, "unknown command 'photogrammetry'; the commands are scene, tile, ");
  says({"scene", "stadum", "out"}, "did you mean 'stadium'?");
  says({"--quiet", "extract", "x"}, "options come after the command: `tileflight COMMAND … --quiet`");
  says({}, "a command is required: scene, tile, ");
  says({"extract", "x", "--out", "y", "--voxl", "2"},
       "`tileflight extract` has no option --voxl; did you mean '--voxel'?");
  says({"extract", "x", "--ou", "y"}, "did you mean '--out'?");
  says({"render", "x", "--flight=f", "--out=o", "--sample=4"}, "did you mean '--samples'?");
  says({"extract", "x", "--out", "y", "--zzzzzz"}, "`tileflight extract --help` lists them");
  says({"extract", "x"}, "extract: --out is required; see `tileflight extract --help`");
  says({"extract", "x", "--out", "y", "--voxel", "-1"}, "extract: --voxel must not be negative, got -1");
  says({"extract", "x", "--out", "y", "--voxel", "0"}, "extract: --voxel must be more than 0, got 0");
  says({"extract", "x", "--out", "y", "--block", "0"},
       "extract: --block: must be a length above zero, in metres, or auto, got 0");
  says({"extract", "x", "--out", "y", "--threads", "0"}, "extract: --threads must be 1 to 1024, got 0");
  says({"extract", "x", "--out", "y", "--size", "1,2"}, "--size takes at least 3 comma-separated values, got 2");
  says({"render", "x", "--flight", "f", "--out", "o", "--resolution", "640x480"},
       "--resolution: must be W,H in pixels, as in 640,480, got 640x480");
  says({"export", "x", "--out", "y", "--layout", "eurok"}, "'eurok'; did you mean 'euroc'?");
  says({"extract", "x", "--out", "y", "z"}, "extract: ");
}

TEST(CommandLine, WorkThatFailsIsOneLineAndExitCodeOne) {
  const tests::TemporaryFolder folder;
  const std::string out = (folder / "out").string();
  const std::vector<std::vector<std::string>> calls{
      {"tile", "/nonexistent/mesh.obj", "--out", out},
      {"inspect", "/nonexistent/tileset.json"},
      {"inspect", "/nonexistent/tileset.json", "--map", out + ".png"},
      {"inspect", "/nonexistent/tileset.json", "--at-local", "0,0"},
      {"preview", "/nonexistent/tileset.json", "--flight", "/nonexistent/flight.yaml", "--out", out},
      {"extract", "/nonexistent/tileset.json", "--out", out},
      {"render", "/nonexistent/tileset.json", "--flight", "/nonexistent/flight.yaml", "--out", out},
      {"lens", "/nonexistent.mp4", "--profiles", "/nonexistent", "--out", out},
      {"ingest", "/nonexistent.mp4", "--camera", "/nonexistent.yaml", "--out", out},
      {"new", out, "--video", "/nonexistent.mp4"},
      {"export", "/nonexistent", "--layout", "euroc", "--out", out},
      {"odometry", "/nonexistent", "--out", out},
      {"align", "/nonexistent", "--to", "/nonexistent", "--out", out},
      {"evaluate", "/nonexistent", "--truth", "/nonexistent", "--transform", "/nonexistent", "--out", out},
      {"compare", "/nonexistent/a.json", "/nonexistent/b.json"},
      {"localize", "/nonexistent", "--to", "/nonexistent", "--out", out},
      {"run", "/nonexistent.yaml", "--out", out},
      {"report", "/nonexistent"},
      {"serve", "/nonexistent/tileset.json", "--port", "0"},
      {"play", "/nonexistent", "--foxglove", "--port", "0"}};
  for (const std::vector<std::string>& call : calls) {
    const ProgramResult result = run_tileflight(call);
    EXPECT_EQ(result.exit_code, 1) << call[0];
    EXPECT_EQ(tests::line_count(result.err), 1) << call[0] << ": " << result.err;
    EXPECT_THAT(result.err, HasSubstr("nonexistent")) << call[0];
    EXPECT_EQ(result.out, "") << call[0];
    EXPECT_FALSE(std::filesystem::exists(out)) << call[0];
  }
}

TEST(CommandLine, ATimeOffsetIsAutoOrSeconds) {
  const auto ingest = [](const std::vector<std::string>& more) {
    std::vector<std::string> call{"ingest", "/nonexistent.mp4", "--camera", "/nonexistent.yaml",
                                  "--out",  "/nonexistent"};
    call.insert(call.end(), more.begin(), more.end());
    return run_tileflight(call);
  };
  for (const char* wrong : {"1e999", "nan", "-inf", "soon", "1s"}) {
    const ProgramResult result = ingest({"--telemetry", "log.srt", "--time-offset", wrong});
    EXPECT_EQ(result.exit_code, 2) << wrong;
    EXPECT_THAT(result.err, HasSubstr("'auto' or a number of seconds, got '" + std::string(wrong) + "'"));
  }
  EXPECT_EQ(ingest({"--time-offset", "auto"}).exit_code, 2) << "of no log";
  for (const char* right : {"-1.25", "+3", "auto"})
    EXPECT_EQ(ingest({"--telemetry", "log.srt", "--time-offset", right}).exit_code, 1)
        << "only the files are not there";
}

TEST(CommandLine, VersionSaysCommitCompilerAndWhatWasBuiltIn) {
  const ProgramResult result = run_tileflight({"--version"});
  EXPECT_EQ(result.exit_code, 0);
  EXPECT_THAT(result.out, ContainsRegex("^tileflight [0-9]+\\.[0-9]+\\.[0-9]+\n"));
  EXPECT_THAT(result.out, ContainsRegex("\ncommit ([0-9a-f]{12}|.*-g[0-9a-f]{12}|v[0-9.]+|unknown)"));
  EXPECT_THAT(result.out, ContainsRegex("\nbuilt by (GNU|Clang) [0-9.]+, [A-Za-z]+\nwith Embree [34]\\.[0-9.]+"));
}

}  // namespace
}  // namespace tileflight::command_line_test
