#pragma once

#include <gtest/gtest.h>

#include <exception>
#include <string>

#include "tileflight/core/base/input_error.h"

namespace tileflight::tests {

/// The one line with which `call` refuses its input (InputError); "no error" where it takes it.
template <typename Call>
std::string refusal_of(const Call& call) {
  try {
    call();
  } catch (const InputError& error) {
    const std::string line = error.what();
    EXPECT_EQ(line.find('\n'), std::string::npos) << line;
    return line;
  }
  return "no error";
}

/// Returns the message of any exception of `call`; "no error" if there is none.
template <typename Call>
std::string message_of(const Call& call) {
  try {
    call();
  } catch (const std::exception& error) {
    return error.what();
  }
  return "no error";
}

}  // namespace tileflight::tests
