#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "tileflight/imaging/image.h"
#include "tileflight/simulator/name_pattern.h"

namespace tileflight::simulator {

/// The colour of each segmentation id: AirSim's for 0, 1, 2 and 7, our own for the others; all distinct.
const std::array<imaging::Rgb8, 256>& segmentation_palette();

/// AirSim's default id of an object: (5 + the sum of the ASCII codes of the letters, and of the ASCII characters that
/// follow them, in its lower-cased name) modulo 256.
int default_segmentation_id(const std::string& name);

/// Assigns segmentation ids to object names. Thread-safe.
class SegmentationIds {
 public:
  /// `by_names`: default ids are computed from the names; otherwise all are 0.
  explicit SegmentationIds(bool by_names) : by_names_(by_names) {}

  /// Sets the id of all matching names (a whole name; a pattern is case-insensitive), including those of tiles loaded
  /// later. Returns whether any of `names` matched. Throws InputError: an id outside -1 to 255, an invalid pattern,
  /// more than 10000 rules.
  bool set(const std::string& name, int id, bool is_pattern, const std::vector<std::string>& names);
  int lookup(const std::string& name) const;
  /// Looks up many names efficiently.
  std::vector<int> lookup(const std::vector<std::string>& names) const;

 private:
  struct Rule {
    std::string name;
    std::shared_ptr<const NamePattern> pattern;  ///< nullptr: a plain name
    int id = 0;
  };
  int find_id(const std::string& name) const;

  bool by_names_;
  mutable std::mutex mutex_;
  std::vector<Rule> patterns_;          ///< in the order in which they were set
  std::map<std::string, int> by_name_;  ///< ids of plain names, overridden by later patterns that match
};

}  // namespace tileflight::simulator
