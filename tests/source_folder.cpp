#include "tests/source_folder.h"

namespace tileflight::tests {

std::filesystem::path source_folder() { return TILEFLIGHT_SOURCE_DIR; }

}  // namespace tileflight::tests
