#pragma once

#include <algorithm>
#include <exception>
#include <functional>
#include <stdexcept>
#include <string>
#include <vector>

namespace tileflight::jobs {

/// The processes that share one job, as seen by one of them; each runs the same program with the same arguments.
class Ranks {
 public:
  virtual ~Ranks() = default;

  virtual int rank() const = 0;   ///< index of this process, from 0
  virtual int count() const = 0;  ///< number of processes
  /// Sends a text to every process and returns those of all, by rank. Blocks until all processes have called it.
  virtual std::vector<std::string> all_gather(const std::string& text) = 0;
  /// Sends bytes to each process, those of `to[rank]`, and returns what each has sent to this one, by rank. Blocks
  /// until all processes have called it. Precondition: as many as there are processes.
  virtual std::vector<std::string> exchange(std::vector<std::string> to) = 0;
  /// Sets the message printed to standard error when this process is terminated because another one died or the job was
  /// cancelled; an empty text or no function: nothing is printed.
  virtual void set_termination_message(std::function<std::string()> last_words) = 0;
};

/// A failure of one process that is known to all: each throws it, one reports it.
class CollectiveError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Runs `work` on each process; continues only if none has failed. Throws CollectiveError with the failures and their
/// ranks, or the single failure if all are equal. A single process throws the exception of `work`.
template <class Work>
void run_collectively(Ranks& ranks, const Work& work) {
  if (ranks.count() == 1) return work();
  std::string failure;
  try {
    work();
  } catch (const std::exception& fault) {
    failure = fault.what();
    if (failure.empty()) failure = "failed";
  }
  const std::vector<std::string> failures = ranks.all_gather(failure);
  const bool all_same = std::all_of(failures.begin(), failures.end(), [&](const auto& f) { return f == failures[0]; });
  if (all_same && failures[0].empty()) return;
  if (all_same) throw CollectiveError(failures[0]);
  std::string text;
  for (std::size_t r = 0; r < failures.size(); ++r) {
    if (failures[r].empty()) continue;
    text += (text.empty() ? "rank " : "; rank ") + std::to_string(r) + ": " + failures[r];
  }
  throw CollectiveError(text);
}

/// A job with a single process.
class SingleRank : public Ranks {
 public:
  int rank() const override { return 0; }
  int count() const override { return 1; }
  std::vector<std::string> all_gather(const std::string& text) override { return {text}; }
  std::vector<std::string> exchange(std::vector<std::string> to) override { return to; }
  void set_termination_message(std::function<std::string()>) override {}
};

}  // namespace tileflight::jobs
