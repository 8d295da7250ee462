// `tileflight report`: made again from a folder, and opened by the desktop's program where there is one.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/run_program.h"

namespace tileflight::report_command_test {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using tests::file_text;
using tests::ProgramResult;
using tests::run_tileflight;

class ReportCommand : public testing::Test {
 protected:
  void SetUp() override {
    fs::create_directories(folder_ / "bin");
    std::ofstream(folder_ / "results.json") << R"({"name": "nothing yet"})";
  }

  /// A program in the place of the desktop's.
  void write_opener(const std::string& commands) const {
    const fs::path opener = folder_ / "bin/xdg-open";
    std::ofstream(opener) << "#!/bin/sh\n" << commands << "\n";
    fs::permissions(opener, fs::perms::owner_all);
  }

  ProgramResult open() const {
    return run_tileflight({"report", (folder_ / "").string(), "--open"},
                          "PATH=" + tests::shell_quoted((folder_ / "bin").string()));
  }

  tests::TemporaryFolder folder_;
};

TEST_F(ReportCommand, OpensThePageByItsFullName) {
  write_opener("echo \"$1\" > " + (folder_ / "opened").string());
  const ProgramResult result = open();
  EXPECT_EQ(result.exit_code, 0) << result.err;
  const std::string page = (folder_ / "report.html").string();
  EXPECT_EQ(file_text(folder_ / "opened"), page + "\n");
  EXPECT_THAT(result.out, HasSubstr("report: " + page));
  EXPECT_TRUE(fs::exists(page));
}

TEST_F(ReportCommand, SaysWhereThereIsNoDesktop) {
  ProgramResult result = open();
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_EQ(tests::line_count(result.err), 1) << result.err;
  EXPECT_THAT(result.err, HasSubstr("xdg-open is not installed"));
  EXPECT_TRUE(fs::exists(folder_ / "report.html"));
  write_opener("exit 3");
  result = open();
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.err, HasSubstr("xdg-open found no browser"));
}

TEST_F(ReportCommand, DoesNotWaitForAViewerThatStaysOpen) {
  write_opener("exec /bin/sleep 6");
  EXPECT_EQ(open().exit_code, 0);
}

}  // namespace
}  // namespace tileflight::report_command_test
