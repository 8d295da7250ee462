#include "tileflight/experiments/experiment/command_files.h"

#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <sstream>
#include <string_view>

namespace tileflight::experiment {
namespace fs = std::filesystem;
namespace {

constexpr std::string_view kWordSeparators = " \t\n;|&<>()";

/// Splits a command into words like a shell and removes quotes (POSIX shell, "Quoting", "Token Recognition").
std::vector<std::string> shell_words(const std::string& command) {
  std::vector<std::string> words(1);
  char quote = '\0';
  for (std::size_t i = 0; i < command.size(); ++i) {
    const char c = command[i];
    if (c == '\\' && quote != '\'' && i + 1 < command.size()) {
      words.back() += command[++i];
    } else if (quote != '\0') {
      if (c == quote) {
        quote = '\0';
      } else {
        words.back() += c;
      }
    } else if (c == '\'' || c == '"') {
      quote = c;
    } else if (kWordSeparators.find(c) != std::string_view::npos) {
      if (!words.back().empty()) words.emplace_back();
    } else {
      words.back() += c;
    }
  }
  return words;
}

bool is_file(const fs::path& path) {
  std::error_code error;
  return fs::is_regular_file(path, error);
}

/// Empty if there is none.
fs::path find_program(const std::string& name) {
  const char* path = std::getenv("PATH");
  if (path == nullptr || name.find('/') != std::string::npos) return {};
  std::istringstream folders(path);
  for (std::string folder; std::getline(folders, folder, ':');) {
    const fs::path program = fs::path(folder.empty() ? "." : folder) / name;
    if (is_file(program) && ::access(program.c_str(), X_OK) == 0) return program;
  }
  return {};
}

fs::path file_of(const std::string& word, const fs::path& folder) {
  if (word.empty()) return {};
  const char* home = std::getenv("HOME");
  const fs::path named = word.starts_with("~/") && home != nullptr ? fs::path(home) / word.substr(2) : folder / word;
  return is_file(named) ? named.lexically_normal() : find_program(word);
}

}  // namespace

std::vector<fs::path> find_command_files(const std::string& command, const fs::path& folder) {
  std::vector<fs::path> files;
  const auto add = [&](const std::string& word) {
    const fs::path file = file_of(word, folder);
    if (!file.empty() && std::ranges::find(files, file) == files.end()) files.push_back(file);
  };
  for (const std::string& word : shell_words(command)) {
    add(word);
    if (const std::size_t mark = word.find('='); mark != std::string::npos) add(word.substr(mark + 1));
  }
  return files;
}

}  // namespace tileflight::experiment
