#include "tileflight/tiles/tile_content/attribution.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string_view>

#include "tileflight/core/base/raw_bytes.h"
#include "tileflight/tiles/tile_content/content.h"
#include "tileflight/tiles/tile_content/tile_table.h"

namespace tileflight::tile_content {

void AttributionCollector::add(const std::string& copyright) {
  std::istringstream holders(copyright);
  for (std::string holder; std::getline(holders, holder, ';');) {
    const std::size_t first = holder.find_first_not_of(" \t\r\n");
    if (first == std::string::npos) continue;
    const std::size_t last = holder.find_last_not_of(" \t\r\n");
    ++counts_[holder.substr(first, last - first + 1)];
  }
}

std::vector<std::string> AttributionCollector::sorted_holders() const {
  std::vector<std::pair<std::string, int>> holders(counts_.begin(), counts_.end());
  std::stable_sort(holders.begin(), holders.end(), [](const auto& a, const auto& b) { return a.second > b.second; });
  std::vector<std::string> names;
  for (const auto& [name, count] : holders) names.push_back(name);
  return names;
}

namespace {

/// asset.copyright of a glTF's JSON; empty: none.
std::string copyright_of(std::string_view json_text) {
  const auto json = nlohmann::json::parse(json_text, nullptr, false);
  const nlohmann::json::json_pointer place("/asset/copyright");
  return json.is_object() && json.contains(place) && json.at(place).is_string() ? json.at(place).get<std::string>()
                                                                                : "";
}

}  // namespace

std::vector<std::string> find_copyrights(std::span<const std::byte> content) {
  // GLB (glTF 2.0, section 4.4): magic, version, length; the first chunk's length, its type, the JSON.
  constexpr std::size_t kBeforeJson = 20;
  constexpr std::string_view kMagic = "glTF", kJsonChunk = "JSON";
  std::vector<std::string> found;
  const auto add = [&found](std::string_view json_text) {
    if (const std::string copyright = copyright_of(json_text); !copyright.empty()) found.push_back(copyright);
  };
  const std::string_view text = base::as_text(content);
  if (detect_content_format(content) == "JSON") add(text);
  for (std::size_t at = text.find(kMagic); at != std::string_view::npos; at = text.find(kMagic, at + 1)) {
    if (text.size() - at < kBeforeJson || text.substr(at + 16, 4) != kJsonChunk) continue;
    add(text.substr(at + kBeforeJson, base::read_raw<std::uint32_t>(content, at + 12)));
  }
  return found;
}

}  // namespace tileflight::tile_content
