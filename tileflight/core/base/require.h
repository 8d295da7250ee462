#pragma once

#include <string>

#include "tileflight/core/base/input_error.h"

namespace tileflight::base {

/// Throws InputError(where, what) unless `holds`.
inline void require(bool holds, const std::string& where, const std::string& what) {
  if (!holds) throw InputError(where, what);
}

}  // namespace tileflight::base
