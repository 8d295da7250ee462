#include "tileflight/experiment/version.h"

namespace tileflight::experiment {

std::string version() { return TILEFLIGHT_VERSION; }

std::string commit() { return TILEFLIGHT_COMMIT; }

}  // namespace tileflight::experiment
