#pragma once

#include <memory>
#include <string>

namespace tileflight::simulator {

/// A client's regular expression for whole names. Matching takes time linear in the name's length for any expression
/// (RE2: no backtracking), with bounded memory; features that need backtracking (backreferences, lookahead) are not
/// supported.
class NamePattern {
 public:
  enum class Case { kHeeded, kIgnored };

  /// Throws InputError: longer than 1000 characters, or not a valid expression.
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
