#pragma once

#include <stdexcept>
#include <string>

namespace tileflight {

/// Unusable input given by a user (file, network answer, option). The message is one line: where (file, tile, byte,
/// key), what is wrong, what to do. A bug is an assert, never an InputError.
class InputError : public std::runtime_error {
 public:
  /// `where`: file, tile or option; `what`: the fault and, where it helps, the cure.
  InputError(const std::string& where, const std::string& what) : std::runtime_error(where + ": " + what) {}
};

}  // namespace tileflight

namespace tileflight::base {

/// Throws InputError(where, what) unless `holds`.
inline void require(bool holds, const std::string& where, const std::string& what) {
  if (!holds) throw InputError(where, what);
}

}  // namespace tileflight::base
