#include "tileflight/tiles/attribution.h"

#include <algorithm>
#include <sstream>

namespace tileflight::tiles {

void Attribution::add(const std::string& copyright) {
  std::istringstream holders(copyright);
  for (std::string holder; std::getline(holders, holder, ';');) {
    const std::size_t first = holder.find_first_not_of(" \t\r\n");
    if (first == std::string::npos) continue;
    const std::size_t last = holder.find_last_not_of(" \t\r\n");
    ++counts_[holder.substr(first, last - first + 1)];
  }
}

std::vector<std::string> Attribution::sorted() const {
  std::vector<std::pair<std::string, int>> holders(counts_.begin(), counts_.end());
  std::stable_sort(holders.begin(), holders.end(), [](const auto& a, const auto& b) { return a.second > b.second; });
  std::vector<std::string> names;
  for (const auto& [name, count] : holders) names.push_back(name);
  return names;
}

}  // namespace tileflight::tiles
