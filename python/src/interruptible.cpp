#include "interruptible.h"

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <exception>
#include <mutex>
#include <string>
#include <thread>

namespace tileflight::python {
namespace {

namespace py = pybind11;

/// Thrown from a progress report to end the work. It is no std::exception, because work may take those for failures of
/// a part of it.
struct Cancelled {};

struct Report {
  std::int64_t done = 0, total = 0;
  std::string what;
};

/// Runs work in a thread and keeps its latest progress report and its failure.
class Worker {
 public:
  explicit Worker(const std::function<void(const Progress&)>& work) : thread_([this, &work] { run(work); }) {}
  ~Worker() { join(); }
  Worker(const Worker&) = delete;
  Worker& operator=(const Worker&) = delete;

  /// Waits at most 20 ms. Returns whether the work has ended.
  bool wait() {
    std::unique_lock lock(mutex_);
    return changed_.wait_for(lock, std::chrono::milliseconds(20), [this] { return ended_; });
  }
  std::optional<Report> take_report() {
    const std::lock_guard lock(mutex_);
    return std::exchange(report_, std::nullopt);
  }
  void cancel() { cancelled_ = true; }
  void join() {
    if (thread_.joinable()) thread_.join();
  }
  std::exception_ptr failure() const { return failure_; }

 private:
  void run(const std::function<void(const Progress&)>& work) {
    try {
      work([this](std::int64_t done, std::int64_t total, std::string_view what) {
        if (cancelled_) throw Cancelled();
        const std::lock_guard lock(mutex_);
        report_ = Report{done, total, std::string(what)};
      });
    } catch (...) {
      failure_ = std::current_exception();
    }
    const std::lock_guard lock(mutex_);
    ended_ = true;
    changed_.notify_all();
  }

  std::mutex mutex_;
  std::condition_variable changed_;
  bool ended_ = false;
  std::optional<Report> report_;
  std::atomic<bool> cancelled_ = false;
  std::exception_ptr failure_;
  std::thread thread_;  ///< last: it uses the others
};

/// Handles signals and passes the latest report on. The caller holds the interpreter's lock. Throws
/// py::error_already_set.
void attend_to_interpreter(const py::object& progress, Worker& worker) {
  if (PyErr_CheckSignals() != 0) throw py::error_already_set();
  const std::optional<Report> report = worker.take_report();
  if (report && !progress.is_none()) progress(report->done, report->total, report->what);
}

}  // namespace

void run_interruptibly(const py::object& progress, const std::function<void(const Progress&)>& work,
                       const std::function<void()>& cancel) {
  std::optional<py::error_already_set> raised;
  std::exception_ptr failure;
  {
    const py::gil_scoped_release unlocked;
    Worker worker(work);
    for (bool ended = false; !ended;) {
      ended = worker.wait();
      if (raised) continue;
      const py::gil_scoped_acquire locked;
      try {
        attend_to_interpreter(progress, worker);
      } catch (py::error_already_set& error) {
        raised.emplace(std::move(error));
        worker.cancel();
        const py::gil_scoped_release unlocked_again;
        if (cancel) cancel();
      }
    }
    worker.join();
    failure = worker.failure();
  }
  if (raised) throw std::move(*raised);
  if (failure) std::rethrow_exception(failure);
}

}  // namespace tileflight::python
