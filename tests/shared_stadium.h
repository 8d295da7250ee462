#pragma once

#include <stdexcept>

#include "tests/run_program.h"
#include "tests/shared_result.h"

namespace tileflight::tests {

/// The built-in place as `tileflight scene stadium` writes it.
inline SharedResult shared_stadium() {
  return {"stadium", [](const std::filesystem::path& folder) {
            const ProgramResult result = run_tileflight({"scene", "stadium", folder.string(), "--quiet"});
            if (result.exit_code != 0) throw std::runtime_error("tileflight scene stadium: " + result.err);
          }};
}

}  // namespace tileflight::tests
