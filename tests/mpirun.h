#pragma once

#ifdef TILEFLIGHT_MPIRUN
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "tests/run_program.h"

namespace tileflight::tests {

/// As root in a container with fewer cores than processes, which may not read each other's memory.
inline constexpr const char* kMpirun =
    "OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1 OMPI_MCA_btl_vader_single_copy_mechanism=none "
    "exec " TILEFLIGHT_MPIRUN " --oversubscribe --bind-to none";

/// Runs tileflight as several processes.
inline ProgramResult run_by_mpirun(int processes, const std::vector<std::string>& arguments) {
  std::vector<std::string> words{"-n", std::to_string(processes), TILEFLIGHT_BINARY};
  words.insert(words.end(), arguments.begin(), arguments.end());
  return run_command(words, kMpirun);
}

/// The process that mpirun started as this rank and whose command line contains `text`.
inline std::optional<int> process_of_rank(int rank, const std::string& text) {
  for (const auto& entry : std::filesystem::directory_iterator("/proc")) {
    const std::string name = entry.path().filename().string();
    if (name.find_first_not_of("0123456789") != std::string::npos) continue;
    const std::string environment = '\0' + file_text(entry.path() / "environ");
    const std::string variable = std::string(1, '\0') + "OMPI_COMM_WORLD_RANK=" + std::to_string(rank) + '\0';
    if (environment.find(variable) != std::string::npos &&
        file_text(entry.path() / "cmdline").find(text) != std::string::npos)
      return std::stoi(name);
  }
  return std::nullopt;
}

}  // namespace tileflight::tests
#endif
