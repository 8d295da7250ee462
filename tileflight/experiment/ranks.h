#pragma once

#include <algorithm>
#include <exception>
#include <functional>
#include <stdexcept>
#include <string>
#include <vector>

namespace tileflight::experiment {

/// The processes that do one job together, as one of them sees it; each runs the same program with the same arguments.
class Ranks {
 public:
  virtual ~Ranks() = default;

  virtual int rank() const = 0;   ///< of this process, from 0
  virtual int count() const = 0;  ///< of all
  /// Gives every process a text and returns those of all, by rank. Waits until all have come here.
  virtual std::vector<std::string> exchange(const std::string& text) = 0;
  /// What is said on standard error where this process is asked to end because another one died or somebody stops them
  /// all; an empty text or no function: nothing.
  virtual void set_last_words(std::function<std::string()> last_words) = 0;
};

/// What one process failed at and all of them know: each throws it, one says it.
class FailedTogether : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Each process does its `work`, and all go on only where none has failed. Throws FailedTogether: the failures with the
/// ranks that they are of, or the one failure where all have the same. One process by itself throws what `work` throws.
template <class Work>
void together(Ranks& ranks, const Work& work) {
  if (ranks.count() == 1) return work();
  std::string failure;
  try {
    work();
  } catch (const std::exception& fault) {
    failure = fault.what();
    if (failure.empty()) failure = "failed";
  }
  const std::vector<std::string> failures = ranks.exchange(failure);
  const bool all_same = std::all_of(failures.begin(), failures.end(), [&](const auto& f) { return f == failures[0]; });
  if (all_same && failures[0].empty()) return;
  if (all_same) throw FailedTogether(failures[0]);
  std::string text;
  for (std::size_t r = 0; r < failures.size(); ++r) {
    if (failures[r].empty()) continue;
    text += (text.empty() ? "rank " : "; rank ") + std::to_string(r) + ": " + failures[r];
  }
  throw FailedTogether(text);
}

/// One process by itself.
class OneRank : public Ranks {
 public:
  int rank() const override { return 0; }
  int count() const override { return 1; }
  std::vector<std::string> exchange(const std::string& text) override { return {text}; }
  void set_last_words(std::function<std::string()>) override {}
};

}  // namespace tileflight::experiment
