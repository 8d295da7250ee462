#include "tileflight/live/rpc/worker_pool.h"

#include <chrono>

namespace tileflight::rpc {

WorkerPool::~WorkerPool() {
  std::list<std::thread> workers;
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
    waiting_.clear();
    workers.splice(workers.end(), workers_);
    workers.splice(workers.end(), ended_);
  }
  wake_.notify_all();
  for (std::thread& worker : workers) worker.join();
}

void WorkerPool::submit(std::function<void()> work) {
  {
    const std::lock_guard lock(mutex_);
    if (stopping_) return;
    join_ended();
    waiting_.push_back(std::move(work));
    add_worker_if_needed();
  }
  wake_.notify_one();
}

bool WorkerPool::begin_waiting() {
  const std::lock_guard lock(mutex_);
  if (parked_ >= max_waiting_) return false;
  ++parked_;
  if (!stopping_) add_worker_if_needed();
  return true;
}

void WorkerPool::end_waiting() {
  const std::lock_guard lock(mutex_);
  --parked_;
}

void WorkerPool::add_worker_if_needed() {
  const std::size_t free = workers_.size() - running_;
  if (waiting_.size() <= free || workers_.size() >= max_workers_ + parked_) return;
  const auto self = workers_.emplace(workers_.end());
  *self = std::thread([this, self] { work_until_idle(self); });
}

std::size_t WorkerPool::workers() const {
  const std::lock_guard lock(mutex_);
  return workers_.size();
}

void WorkerPool::join_ended() {
  for (std::thread& worker : ended_) worker.join();
  ended_.clear();
}

void WorkerPool::work_until_idle(std::list<std::thread>::iterator self) {
  std::unique_lock lock(mutex_);
  const auto ready = [this] { return stopping_ || !waiting_.empty(); };
  while (wake_.wait_for(lock, std::chrono::duration<double>(idle_s_), ready) && !stopping_) {
    {
      const std::function<void()> work = std::move(waiting_.front());
      waiting_.pop_front();
      ++running_;
      lock.unlock();
      work();
    }
    lock.lock();
    --running_;
  }
  if (!stopping_) ended_.splice(ended_.end(), workers_, self);
}

}  // namespace tileflight::rpc
