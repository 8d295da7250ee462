#pragma once

#include <string>

namespace tileflight::base {

/// The text as one word of a POSIX shell's command line, whatever characters it holds.
inline std::string shell_word(const std::string& text) {
  std::string result = "'";
  for (const char c : text) result += c == '\'' ? "'\\''" : std::string(1, c);
  return result + "'";
}

}  // namespace tileflight::base
