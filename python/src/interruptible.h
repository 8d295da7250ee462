#pragma once

#include <pybind11/pybind11.h>

#include <functional>
#include <optional>
#include <utility>

#include "tileflight/core/base/progress.h"

namespace tileflight::python {

/// Runs `work` in a thread of its own while the calling one, the interpreter's, waits with the lock released: other
/// Python threads go on, and every 20 ms pending signals are handled and `progress` (a callable or None) is called as
/// progress(done, total, what) with the latest report. If a signal's handler (KeyboardInterrupt) or `progress` raises,
/// the work ends at its next progress report, and the exception is passed on; `cancel`, if not empty, is called then to
/// end work that reports none. Neither `work` nor `cancel` may touch Python objects.
void run_interruptibly(const pybind11::object& progress, const std::function<void(const Progress&)>& work,
                       const std::function<void()>& cancel = {});

/// The same for work with a result.
template <class Work>
auto call_interruptibly(const pybind11::object& progress, Work&& work, const std::function<void()>& cancel = {}) {
  std::optional<decltype(work(Progress{}))> result;
  run_interruptibly(
      progress, [&](const Progress& report) { result.emplace(work(report)); }, cancel);
  return std::move(*result);
}

}  // namespace tileflight::python
