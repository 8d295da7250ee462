#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "tests/run_program.h"

namespace tileflight::tests {

/// Expects that a program ended with exit code 1 and one line that holds `message`.
inline void expect_one_line_refusal(const ProgramResult& result, const std::string& message) {
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.err, testing::HasSubstr(message));
  EXPECT_EQ(line_count(result.err), 1) << result.err;
}

}  // namespace tileflight::tests
