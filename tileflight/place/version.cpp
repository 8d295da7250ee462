#include "tileflight/place/version.h"

#include "tileflight/base/files.h"

namespace tileflight::place {

std::string version() { return TILEFLIGHT_VERSION; }

std::string commit() { return TILEFLIGHT_COMMIT; }

std::string program_fingerprint() { return base::sha256_hex_of_file("/proc/self/exe"); }

}  // namespace tileflight::place
