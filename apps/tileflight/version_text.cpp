#include "version_text.h"

#include "tileflight/place/version.h"

namespace tileflight::app {

std::string version_text() {
  return "tileflight " + place::version() + "\ncommit " + place::commit() +
         "\nbuilt by " TILEFLIGHT_COMPILER ", " TILEFLIGHT_BUILD_TYPE "\nwith " TILEFLIGHT_BUILT_WITH;
}

}  // namespace tileflight::app
