#include "tileflight/core/base/program_path.h"

#include <system_error>
#include <utility>

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

}  // namespace tileflight::base
