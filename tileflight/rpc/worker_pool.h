#pragma once

#include <condition_variable>
#include <cstddef>
#include <deque>
#include <functional>
#include <list>
#include <mutex>
#include <thread>

namespace tileflight::rpc {

/// Threads for work that may wait for long (a flight of minutes holds its thread): one is added whenever there is work
/// and nobody free, up to a bound; one that has had nothing to do for a while ends.
class WorkerPool {
 public:
  WorkerPool(std::size_t max_workers, double idle_s) : max_workers_(max_workers), idle_s_(idle_s) {}
  /// Waits for the work that has begun; what has not is dropped.
  ~WorkerPool();
  WorkerPool(const WorkerPool&) = delete;
  WorkerPool& operator=(const WorkerPool&) = delete;

  /// `work` must not throw. Begun in the order of submission.
  void submit(std::function<void()> work);

  struct Counts {
    std::size_t workers = 0;
    std::size_t running = 0;
    std::size_t waiting = 0;
  };
  Counts counts() const;

 private:
  void work_until_idle(std::list<std::thread>::iterator self);
  void join_ended();

  std::size_t max_workers_;
  double idle_s_;
  mutable std::mutex mutex_;
  std::condition_variable wake_;
  std::deque<std::function<void()>> waiting_;
  std::list<std::thread> workers_;
  std::list<std::thread> ended_;  ///< to be joined
  std::size_t running_ = 0;
  bool stopping_ = false;
};

}  // namespace tileflight::rpc
