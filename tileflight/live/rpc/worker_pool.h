#pragma once

#include <condition_variable>
#include <cstddef>
#include <deque>
#include <functional>
#include <list>
#include <mutex>
#include <thread>

namespace tileflight::rpc {

/// Threads for work that may block for long (a flight of minutes holds its thread): a thread is added when there is
/// work and no thread is idle, up to a maximum; a thread that stays idle for a while ends. Work that only waits says so
/// (begin_waiting()), and its thread is not counted: it takes no other work's place.
class WorkerPool {
 public:
  WorkerPool(std::size_t max_workers, std::size_t max_waiting, double idle_s)
      : max_workers_(max_workers), max_waiting_(max_waiting), idle_s_(idle_s) {}
  /// Waits for running work; queued work is dropped.
  ~WorkerPool();
  WorkerPool(const WorkerPool&) = delete;
  WorkerPool& operator=(const WorkerPool&) = delete;

  /// `work` must not throw. Work starts in the order of submission.
  void submit(std::function<void()> work);

  /// Called by work that will wait for long. Returns false if `max_waiting` others wait already: it is
  /// counted as other work.
  bool begin_waiting();
  /// Called by the same work once it has waited.
  void end_waiting();

  /// Threads that work or wait for work.
  std::size_t workers() const;

 private:
  void add_worker_if_needed();
  void work_until_idle(std::list<std::thread>::iterator self);
  void join_ended();

  std::size_t max_workers_, max_waiting_;
  double idle_s_;
  mutable std::mutex mutex_;
  std::condition_variable wake_;
  std::deque<std::function<void()>> waiting_;
  std::list<std::thread> workers_;
  std::list<std::thread> ended_;  ///< to be joined
  std::size_t running_ = 0;
  std::size_t parked_ = 0;  ///< of running_: works that wait
  bool stopping_ = false;
};

}  // namespace tileflight::rpc
