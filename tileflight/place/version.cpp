#include "tileflight/place/version.h"

#include "tileflight/base/files.h"
#include "tileflight/base/program_path.h"

namespace tileflight::place {

std::string version() { return TILEFLIGHT_VERSION; }

std::string commit() { return TILEFLIGHT_COMMIT; }

std::string program_fingerprint() {
  const std::filesystem::path program = base::program_path();
  // A program that was replaced while it runs is still to be had by this name.
  return base::sha256_hex_of_file(std::filesystem::exists(program) ? program : "/proc/self/exe");
}

}  // namespace tileflight::place
