#pragma once

#include <memory>
#include <string>

namespace tileflight::simulator {

/// A regular expression of a client's for whole names. Matching takes time in proportion to the name whatever the
/// expression is (RE2: no backtracking), and memory has a limit; what only backtracking can do (backreferences, looking
/// ahead) cannot be read.
class NamePattern {
 public:
  enum class Case { kHeeded, kIgnored };

  /// Throws InputError: longer than 1000 characters, or not an expression.
  NamePattern(const std::string& expression, Case letters);
  ~NamePattern();
  NamePattern(const NamePattern&) = delete;
  NamePattern& operator=(const NamePattern&) = delete;

  bool matches(const std::string& name) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tileflight::simulator
