#include "tileflight/core/base/program.h"

#include <gtest/gtest.h>

namespace tileflight::base::program_path_test {
namespace {

TEST(ProgramPath, IsTheRunningProgramUnlessAnotherIsNamed) {
  EXPECT_EQ(program_path().filename(), "base_test");
  set_program_path("/opt/tileflight/bin/tileflight");
  EXPECT_EQ(program_path(), "/opt/tileflight/bin/tileflight");
  set_program_path({});
  EXPECT_EQ(program_path().filename(), "base_test");
}

}  // namespace
}  // namespace tileflight::base::program_path_test
