#pragma once

#include <algorithm>
#include <string>
#include <vector>

namespace tileflight::base {

/// "camera, fps": the texts with a separator between them.
inline std::string joined(const std::vector<std::string>& texts, const char* separator = ", ") {
  std::string result;
  for (const std::string& text : texts) result += (result.empty() ? "" : separator) + text;
  return result;
}

/// Appends those texts of `from` that `to` does not have yet.
inline void add_distinct(const std::vector<std::string>& from, std::vector<std::string>& to) {
  for (const std::string& text : from) {
    if (std::find(to.begin(), to.end(), text) == to.end()) to.push_back(text);
  }
}

}  // namespace tileflight::base
