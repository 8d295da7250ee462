#include "tileflight/core/base/program.h"

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/program_path.h"

namespace tileflight::base {

std::string version() { return TILEFLIGHT_VERSION; }

std::string commit() { return TILEFLIGHT_COMMIT; }

std::string program_fingerprint() {
  const std::filesystem::path program = base::program_path();
  // A program that was replaced while it runs is still to be had by this name.
  return base::sha256_hex_of_file(std::filesystem::exists(program) ? program : "/proc/self/exe");
}

}  // namespace tileflight::base
