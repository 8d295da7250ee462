#pragma once

#include <algorithm>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "tileflight/core/base/input_error.h"
#include "tileflight/live/simulator/object_names.h"

namespace tileflight::simulator {

/// What clients have set for objects by name or by pattern, which also holds for objects that come later. The latest
/// rule that matches a name holds. Not thread-safe.
template <class Value>
class NameRules {
 public:
  /// Sets the value of all matching names (a whole name; a pattern is case-insensitive). Returns whether any of `names`
  /// matched; a plain name that none has sets nothing. Throws InputError: an invalid pattern, more than 10000 patterns.
  bool set(const std::string& name, const Value& value, bool is_pattern, const std::vector<std::string>& names) {
    if (!is_pattern) {
      if (std::ranges::find(names, name) == names.end()) return false;
      by_name_.insert_or_assign(name, value);
      return true;
    }
    auto pattern = std::make_shared<const NamePattern>(name, NamePattern::Case::kIgnored);
    std::erase_if(patterns_, [&](const Rule& rule) { return rule.text == name; });
    if (patterns_.size() >= kMaxPatterns)
      throw InputError("names", "more than " + std::to_string(kMaxPatterns) + " patterns");
    std::erase_if(by_name_, [&](const auto& entry) { return pattern->matches(entry.first); });
    const bool any = std::ranges::any_of(names, [&](const std::string& known) { return pattern->matches(known); });
    patterns_.push_back({name, std::move(pattern), value});
    return any;
  }

  /// nullopt: nothing was set for this name.
  std::optional<Value> find(const std::string& name) const {
    if (const auto at = by_name_.find(name); at != by_name_.end()) return at->second;
    for (auto rule = patterns_.rbegin(); rule != patterns_.rend(); ++rule) {
      if (rule->pattern->matches(name)) return rule->value;
    }
    return std::nullopt;
  }

 private:
  static constexpr std::size_t kMaxPatterns = 10000;

  struct Rule {
    std::string text;
    std::shared_ptr<const NamePattern> pattern;
    Value value;
  };

  std::vector<Rule> patterns_;            ///< in the order in which they were set
  std::map<std::string, Value> by_name_;  ///< later than all patterns that match
};

}  // namespace tileflight::simulator
