#pragma once

#include <string>
#include <type_traits>

namespace tileflight::airsim {

/// Replaces SimulatorCaller in tests of messages: has every method with its types, and returns default values.
struct NullSimulatorCaller {
  template <auto Method, class Result, class... Arguments>
  Result call(Arguments&&...) const {
    if constexpr (!std::is_void_v<Result>) return Result{};
  }

  bool load_level(const std::string& /*name*/) const { return false; }
};

}  // namespace tileflight::airsim
