#pragma once

#include <condition_variable>
#include <functional>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "tileflight/core/jobs/ranks.h"

namespace tileflight::jobs::test_support {

/// Ranks of one program, each on a thread of its own.
class ThreadRanks {
 public:
  explicit ThreadRanks(int count) : count_(count), given_(static_cast<std::size_t>(count)) {}

  /// Runs `work(ranks)` on each of them.
  template <class Work>
  void run(const Work& work) {
    std::vector<std::thread> threads;
    for (int r = 0; r < count_; ++r) {
      threads.emplace_back([&, r] {
        Rank rank(*this, r);
        work(rank);
      });
    }
    for (std::thread& thread : threads) thread.join();
  }

 private:
  class Rank : public Ranks {
   public:
    Rank(ThreadRanks& all, int rank) : all_(all), rank_(rank) {}
    int rank() const override { return rank_; }
    int count() const override { return all_.count_; }
    std::vector<std::string> all_gather(const std::string& text) override {
      std::vector<std::string> texts;
      for (const std::vector<std::string>& of_rank : all_.gather(rank_, {text})) texts.push_back(of_rank.front());
      return texts;
    }
    std::vector<std::string> exchange(std::vector<std::string> to) override {
      std::vector<std::string> from;
      for (const std::vector<std::string>& of_rank : all_.gather(rank_, std::move(to)))
        from.push_back(of_rank[static_cast<std::size_t>(rank_)]);
      return from;
    }
    void set_termination_message(std::function<std::string()>) override {}

   private:
    ThreadRanks& all_;
    int rank_;
  };

  std::vector<std::vector<std::string>> gather(int rank, std::vector<std::string> texts) {
    std::unique_lock lock(mutex_);
    given_[static_cast<std::size_t>(rank)] = std::move(texts);
    const int round = round_;
    if (++here_ == count_) {
      taken_ = given_;
      here_ = 0;
      ++round_;
      changed_.notify_all();
    } else {
      changed_.wait(lock, [&] { return round_ != round; });
    }
    return taken_;
  }

  int count_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<std::vector<std::string>> given_, taken_;
  int here_ = 0, round_ = 0;
};

}  // namespace tileflight::jobs::test_support
