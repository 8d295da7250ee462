#pragma once

#include <tbb/task_group.h>

#include <atomic>
#include <exception>
#include <memory>
#include <mutex>
#include <utility>

#include "tileflight/dataset/dataset.h"

namespace tileflight::dataset {

/// Encodes frames on the other cores while their source decodes the next. At most a few wait; when they do, the thread
/// that brings another encodes it itself. The files are the same in any order.
class EncodeQueue {
 public:
  explicit EncodeQueue(DatasetWriter& writer) : writer_(writer) {}
  ~EncodeQueue() { tasks_.wait(); }
  EncodeQueue(const EncodeQueue&) = delete;
  EncodeQueue& operator=(const EncodeQueue&) = delete;

  /// Throws what an earlier frame's writing threw.
  void add(std::size_t index, double time_s, double exposure_ms, const imaging::RgbImage& image) {
    rethrow();
    if (waiting_.load() >= kMaxWaiting) return writer_.add_frame(index, time_s, exposure_ms, image);
    ++waiting_;
    tasks_.run([this, index, time_s, exposure_ms, copy = std::make_shared<const imaging::RgbImage>(image)] {
      try {
        writer_.add_frame(index, time_s, exposure_ms, *copy);
      } catch (...) {
        const std::lock_guard lock(mutex_);
        if (!failure_) failure_ = std::current_exception();
      }
      --waiting_;
    });
  }

  /// Waits for all frames; throws what writing one threw.
  void finish() {
    tasks_.wait();
    rethrow();
  }

 private:
  static constexpr int kMaxWaiting = 4;

  void rethrow() {
    const std::lock_guard lock(mutex_);
    if (failure_) std::rethrow_exception(failure_);
  }

  DatasetWriter& writer_;
  tbb::task_group tasks_;
  std::atomic<int> waiting_{0};
  std::mutex mutex_;
  std::exception_ptr failure_;
};

}  // namespace tileflight::dataset
