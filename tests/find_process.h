#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "tests/run_program.h"

namespace tileflight::tests {

/// A process of this machine for which `is_it(command line, environment)` is true; the texts end and are separated by
/// zero bytes.
template <class Predicate>
std::optional<int> find_process(const Predicate& is_it) {
  for (const auto& entry : std::filesystem::directory_iterator("/proc")) {
    const std::string name = entry.path().filename().string();
    if (name.find_first_not_of("0123456789") != std::string::npos) continue;
    if (is_it(file_text(entry.path() / "cmdline"), file_text(entry.path() / "environ"))) return std::stoi(name);
  }
  return std::nullopt;
}

}  // namespace tileflight::tests
