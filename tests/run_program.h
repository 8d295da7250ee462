#pragma once

#include <sys/wait.h>

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "tests/temporary_folder.h"

namespace tileflight::tests {

struct ProgramResult {
  int exit_code = -1;  ///< -1: ended by a signal
  std::string out;
  std::string err;
};

inline std::string shell_quoted(const std::string& text) {
  std::string result = "'";
  for (const char c : text) result += c == '\'' ? "'\\''" : std::string(1, c);
  return result + "'";
}

inline std::string file_text(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  std::ostringstream text;
  text << stream.rdbuf();
  return text.str();
}

/// Runs a program with its arguments, without input, and keeps what it prints. `environment`: `NAME=value …`.
inline ProgramResult run_command(const std::vector<std::string>& words, const std::string& environment = "") {
  const TemporaryFolder folder;
  std::string command = environment;
  for (const std::string& word : words) command += " " + shell_quoted(word);
  command += " > " + shell_quoted((folder / "out").string()) + " 2> " + shell_quoted((folder / "err").string()) +
             " < /dev/null";
  const int status = std::system(command.c_str());
  return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, file_text(folder / "out"), file_text(folder / "err")};
}

#ifdef TILEFLIGHT_BINARY
/// Runs the tileflight binary with these arguments.
inline ProgramResult run_tileflight(std::vector<std::string> arguments, const std::string& environment = "") {
  arguments.insert(arguments.begin(), TILEFLIGHT_BINARY);
  return run_command(arguments, environment);
}
#endif

/// Number of lines, as a person would count them.
inline int line_count(const std::string& text) {
  int lines = 0;
  for (const char c : text) lines += c == '\n';
  return lines;
}

}  // namespace tileflight::tests
