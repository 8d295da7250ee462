#pragma once

#include <functional>
#include <string>
#include <variant>
#include <vector>

namespace tileflight::foxglove {

/// std::monostate: a value of a kind that no parameter here has (an array, an object, none).
using ParameterValue = std::variant<std::monostate, bool, double, std::string>;

/// A value that clients see and may set.
struct Parameter {
  std::string name;
  ParameterValue value;
};

/// Access to the parameters behind a server. Called by the server's thread; neither function may call the server.
struct ParameterAccess {
  /// All parameters, in the order in which they are listed.
  std::function<std::vector<Parameter>()> read = [] { return std::vector<Parameter>{}; };
  /// Sets one of them. Throws InputError (name, cause) for an unknown name or an unusable value.
  std::function<void(const Parameter&)> write = {};
};

}  // namespace tileflight::foxglove
