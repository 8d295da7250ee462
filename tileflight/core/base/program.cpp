#include "tileflight/core/base/program.h"

#include <system_error>
#include <utility>

#include "tileflight/core/base/files.h"

namespace tileflight::base {

namespace {

std::filesystem::path& named_program() {
  static std::filesystem::path program;
  return program;
}

}  // namespace

std::filesystem::path program_path() {
  if (!named_program().empty()) return named_program();
  std::error_code failed;
  return std::filesystem::read_symlink("/proc/self/exe", failed);
}

void set_program_path(std::filesystem::path program) { named_program() = std::move(program); }

std::filesystem::path data_folder() {
  const std::filesystem::path program = program_path();
  return program.empty() ? program : program.parent_path().parent_path() / "share/tileflight";
}

std::string version() { return TILEFLIGHT_VERSION; }

std::string commit() { return TILEFLIGHT_COMMIT; }

std::string program_fingerprint() {
  const std::filesystem::path program = base::program_path();
  // A program that was replaced while it runs is still to be had by this name.
  return base::sha256_hex_of_file(std::filesystem::exists(program) ? program : "/proc/self/exe");
}

}  // namespace tileflight::base
