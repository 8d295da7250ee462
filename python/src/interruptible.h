#pragma once

#include <pybind11/pybind11.h>

#include <functional>
#include <optional>
#include <utility>

#include "tileflight/core/base/progress.h"

namespace tileflight::python {

/// Runs `work` in a thread of its own, so that Ctrl-C and other Python threads work meanwhile.
///
/// The calling thread, the interpreter's, waits with the interpreter's lock released. Every 20 ms it handles pending
/// signals and calls `progress` (a callable or None) as progress(done, total, what) with the latest report. If a
/// signal's handler (KeyboardInterrupt) or `progress` raises, the work ends at its next progress report, and the
/// exception is passed on. `cancel`, if not empty, is called then to end work that reports no progress. Neither `work`
/// nor `cancel` may touch Python objects.
void run_interruptibly(const pybind11::object& progress, const std::function<void(const Progress&)>& work,
                       const std::function<void()>& cancel = {});

/// Runs work that has a result in the same way, and returns the result.
template <class Work>
auto call_interruptibly(const pybind11::object& progress, Work&& work, const std::function<void()>& cancel = {}) {
  std::optional<decltype(work(Progress{}))> result;
  run_interruptibly(
      progress, [&](const Progress& report) { result.emplace(work(report)); }, cancel);
  return std::move(*result);
}

}  // namespace tileflight::python
