#pragma once

#include <type_traits>

namespace tileflight::server {

/// Stands in for SimulatorCaller where only messages are looked at: every method is there, with its types, and gives
/// its result's default.
struct NoSimulator {
  template <auto Method, class Result, class... Arguments>
  Result call(Arguments&&...) const {
    if constexpr (!std::is_void_v<Result>) return Result{};
  }
};

}  // namespace tileflight::server
