#include "version_text.h"

#include "tileflight/core/base/program.h"

namespace tileflight::app {

std::string version_text() {
  return "tileflight " + base::version() + "\ncommit " + base::commit() +
         "\nbuilt by " TILEFLIGHT_COMPILER ", " TILEFLIGHT_BUILD_TYPE "\nwith " TILEFLIGHT_BUILT_WITH;
}

}  // namespace tileflight::app
