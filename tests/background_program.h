#pragma once

#include <fcntl.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>
#include <string>
#include <vector>

#include "tests/run_program.h"

namespace tileflight::tests {

/// The tileflight binary at work while a test goes on; killed with the object. What it prints goes to FILE.out,
/// FILE.err.
class BackgroundProgram {
 public:
  BackgroundProgram(const std::vector<std::string>& arguments, const std::filesystem::path& file) : file_(file) {
    process_ = ::fork();
    if (process_ != 0) return;
    redirect(file_.string() + ".out", STDOUT_FILENO);
    redirect(file_.string() + ".err", STDERR_FILENO);
    std::vector<char*> words{const_cast<char*>(TILEFLIGHT_BINARY)};
    for (const std::string& argument : arguments) words.push_back(const_cast<char*>(argument.c_str()));
    words.push_back(nullptr);
    ::execv(words[0], words.data());
    ::_exit(127);
  }
  ~BackgroundProgram() { kill(); }
  BackgroundProgram(const BackgroundProgram&) = delete;
  BackgroundProgram& operator=(const BackgroundProgram&) = delete;

  pid_t process() const { return process_; }
  bool runs() {
    if (process_ > 0 && ::waitpid(process_, &status_, WNOHANG) == process_) process_ = 0;
    return process_ > 0;
  }
  /// Kills the program as `kill -9` does.
  void kill() {
    if (process_ <= 0) return;
    ::kill(process_, SIGKILL);
    ::waitpid(process_, &status_, 0);
    process_ = 0;
  }
  ProgramResult result() {
    if (process_ > 0) ::waitpid(process_, &status_, 0);
    process_ = 0;
    return {WIFEXITED(status_) ? WEXITSTATUS(status_) : -1, file_text(file_.string() + ".out"),
            file_text(file_.string() + ".err")};
  }

 private:
  static void redirect(const std::string& file, int to) {
    const int descriptor = ::open(file.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0666);
    ::dup2(descriptor, to);
  }

  std::filesystem::path file_;
  pid_t process_ = 0;
  int status_ = 0;
};

}  // namespace tileflight::tests
