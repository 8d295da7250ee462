#pragma once

#include <tbb/task_group.h>

#include <atomic>
#include <exception>
#include <memory>
#include <mutex>
#include <utility>

#include "tileflight/data/dataset/dataset.h"

namespace tileflight::dataset {

/// Encodes frames on other cores while the source decodes the next. A few frames may wait; beyond that, the calling
/// thread encodes the frame itself. The files do not depend on the order.
class EncodeQueue {
 public:
  explicit EncodeQueue(DatasetWriter& writer) : writer_(writer) {}
  ~EncodeQueue() { tasks_.wait(); }
  EncodeQueue(const EncodeQueue&) = delete;
  EncodeQueue& operator=(const EncodeQueue&) = delete;

  /// Queues a frame. Throws the exception of an earlier frame's writing.
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

  /// Waits for all frames; throws the exception of a failed one.
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
