#pragma once

#ifdef TILEFLIGHT_MPIRUN
#include <optional>
#include <string>
#include <vector>

#include "tests/find_process.h"
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
  const std::string variable = std::string(1, '\0') + "OMPI_COMM_WORLD_RANK=" + std::to_string(rank) + '\0';
  return find_process([&](const std::string& command, const std::string& environment) {
    return ('\0' + environment).find(variable) != std::string::npos && command.find(text) != std::string::npos;
  });
}

}  // namespace tileflight::tests
#endif
