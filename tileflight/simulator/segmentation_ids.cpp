#include "tileflight/simulator/segmentation_ids.h"

#include <algorithm>
#include <cctype>
#include <set>

#include "tileflight/base/input_error.h"
#include "tileflight/base/random_numbers.h"

namespace tileflight::simulator {
namespace {

using imaging::Rgb8;

constexpr std::size_t kMaxRules = 10000;

std::array<Rgb8, 256> make_palette() {
  std::array<Rgb8, 256> palette{};
  const std::map<std::size_t, Rgb8> published{
      {0, {0, 0, 0}}, {1, {153, 108, 6}}, {2, {112, 105, 191}}, {7, {115, 176, 195}}};
  std::set<Rgb8> used;
  for (const auto& [id, colour] : published) used.insert(colour);
  std::uint64_t state = 0;
  for (std::size_t id = 0; id < palette.size(); ++id) {
    if (const auto at = published.find(id); at != published.end()) {
      palette[id] = at->second;
      continue;
    }
    Rgb8 colour{};
    do {
      const std::uint64_t bits = base::splitmix64_hash(++state);
      colour = {static_cast<std::uint8_t>(bits), static_cast<std::uint8_t>(bits >> 8U),
                static_cast<std::uint8_t>(bits >> 16U)};
    } while (colour[0] + colour[1] + colour[2] < 120 || !used.insert(colour).second);
    palette[id] = colour;
  }
  return palette;
}

}  // namespace

const std::array<Rgb8, 256>& segmentation_palette() {
  static const std::array<Rgb8, 256> kPalette = make_palette();
  return kPalette;
}

int default_segmentation_id(const std::string& name) {
  int sum = 5;
  for (const char c : name) {
    const int code = std::tolower(static_cast<unsigned char>(c));
    if (code >= 97) sum = (sum + code) % 256;
  }
  return sum;
}

bool SegmentationIds::set(const std::string& name, int id, bool is_pattern, const std::vector<std::string>& names) {
  if (id < -1 || id > 255) throw InputError("segmentation id " + std::to_string(id), "must be from -1 to 255");
  const std::shared_ptr<const NamePattern> pattern =
      is_pattern ? std::make_shared<const NamePattern>(name, NamePattern::Case::kIgnored) : nullptr;
  const bool any = std::ranges::any_of(
      names, [&](const std::string& known) { return pattern ? pattern->matches(known) : known == name; });
  const std::lock_guard lock(mutex_);
  if (!pattern) {
    if (!any) return false;
    by_name_[name] = id;
  } else {
    std::erase_if(patterns_, [&](const Rule& rule) { return rule.name == name; });
    if (patterns_.size() >= kMaxRules)
      throw InputError("segmentation ids", "more than " + std::to_string(kMaxRules) + " patterns");
    patterns_.push_back({name, pattern, id});
    std::erase_if(by_name_, [&](const auto& entry) { return pattern->matches(entry.first); });
  }
  return any;
}

int SegmentationIds::find_id(const std::string& name) const {
  if (const auto at = by_name_.find(name); at != by_name_.end()) return at->second;
  for (auto rule = patterns_.rbegin(); rule != patterns_.rend(); ++rule) {
    if (rule->pattern->matches(name)) return rule->id;
  }
  return by_names_ ? default_segmentation_id(name) : 0;
}

int SegmentationIds::lookup(const std::string& name) const {
  const std::lock_guard lock(mutex_);
  return find_id(name);
}

std::vector<int> SegmentationIds::lookup(const std::vector<std::string>& names) const {
  const std::lock_guard lock(mutex_);
  std::vector<int> ids;
  ids.reserve(names.size());
  for (const std::string& name : names) ids.push_back(find_id(name));
  return ids;
}

}  // namespace tileflight::simulator
