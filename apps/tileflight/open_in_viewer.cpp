#include "open_in_viewer.h"

#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <string>
#include <thread>

#include "tileflight/core/base/input_error.h"

namespace tileflight::app {
namespace {

/// xdg-open reports failure within this time; on some desktops it runs as long as the viewer.
constexpr std::chrono::milliseconds kPatience{3000}, kStep{20};

[[noreturn]] void refuse(const std::string& file, const std::string& why) {
  throw InputError(file, "was written but could not be opened: " + why + "; open it in a browser by hand");
}

pid_t spawned(const std::string& file) {
  std::string program = "xdg-open", argument = file;
  char* const arguments[] = {program.data(), argument.data(), nullptr};
  pid_t child = 0;
  const int fault = posix_spawnp(&child, program.c_str(), nullptr, nullptr, arguments, environ);
  if (fault == ENOENT) refuse(file, "xdg-open is not installed (package xdg-utils)");
  if (fault != 0) refuse(file, "xdg-open could not be started");
  return child;
}

}  // namespace

void open_in_viewer(const std::filesystem::path& file) {
  const pid_t child = spawned(file.string());
  for (auto waited = std::chrono::milliseconds(0); waited < kPatience; waited += kStep) {
    int status = 0;
    if (waitpid(child, &status, WNOHANG) == child) {
      if (WIFEXITED(status) && WEXITSTATUS(status) == 0) return;
      refuse(file.string(), "xdg-open found no browser");
    }
    std::this_thread::sleep_for(kStep);
  }
}

}  // namespace tileflight::app
