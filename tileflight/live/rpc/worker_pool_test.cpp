#include "tileflight/live/rpc/worker_pool.h"

#include <gtest/gtest.h>

#include <atomic>
#include <latch>
#include <thread>

namespace tileflight::rpc::worker_pool_test {
namespace {

using std::chrono::milliseconds;

bool soon(const std::function<bool()>& condition) {
  for (int i = 0; i < 5000 && !condition(); ++i) std::this_thread::sleep_for(milliseconds(1));
  return condition();
}

TEST(WorkerPool, GrowsWithWhatIsRunning) {
  WorkerPool pool(8, 8, 10.0);
  std::latch all_run(8);
  std::atomic<int> done{0};
  for (int i = 0; i < 8; ++i) {
    pool.submit([&] {
      all_run.arrive_and_wait();  // returns only if all eight run at once
      ++done;
    });
  }
  EXPECT_TRUE(soon([&] { return done == 8; }));
  EXPECT_EQ(pool.workers(), 8U);
}

TEST(WorkerPool, IsBounded) {
  WorkerPool pool(2, 2, 10.0);
  std::atomic<int> running{0};
  std::atomic<int> most{0};
  std::atomic<int> done{0};
  for (int i = 0; i < 20; ++i) {
    pool.submit([&] {
      const int now = ++running;
      int before = most;
      while (before < now && !most.compare_exchange_weak(before, now)) {
      }
      std::this_thread::sleep_for(milliseconds(1));
      --running;
      ++done;
    });
  }
  EXPECT_TRUE(soon([&] { return done == 20; }));
  EXPECT_EQ(most, 2);
}

TEST(WorkerPool, ShrinksWhenThereIsNothingToDo) {
  WorkerPool pool(8, 8, 0.01);
  std::latch all_run(4);
  for (int i = 0; i < 4; ++i) pool.submit([&] { all_run.arrive_and_wait(); });
  EXPECT_TRUE(soon([&] { return pool.workers() == 0; }));
  std::atomic<bool> ran{false};
  pool.submit([&] { ran = true; });
  EXPECT_TRUE(soon([&] { return ran.load(); }));
}

TEST(WorkerPool, TheEndWaitsForWhatRunsAndDropsTheRest) {
  std::atomic<int> done{0};
  std::latch begun(1);
  {
    WorkerPool pool(1, 1, 10.0);
    pool.submit([&] {
      begun.count_down();
      std::this_thread::sleep_for(milliseconds(20));
      ++done;
    });
    begun.wait();
    pool.submit([&] { done += 100; });
  }
  EXPECT_EQ(done, 1);
}

}  // namespace
}  // namespace tileflight::rpc::worker_pool_test
