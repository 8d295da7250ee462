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

/// The colour of each segmentation id: AirSim's for 0, 1, 2 and 7, our own for the others; all differ.
const std::array<imaging::Rgb8, 256>& segmentation_palette();

/// AirSim's id of an object that nobody gave one: (5 + the codes of its lower-cased name's letters and what follows
/// them in ASCII) modulo 256.
int startup_id(const std::string& name);

/// Which id each object's name has. Thread-safe.
class SegmentationIds {
 public:
  /// `by_names`: ids by the names' letters at the start; else all are 0.
  explicit SegmentationIds(bool by_names) : by_names_(by_names) {}

  /// Names that match (a whole name; as a pattern whatever its case) have this id from now on, also those of tiles that
  /// are read later. Whether any of `names` did. Throws InputError: an id that is not from -1 to 255, a pattern that
  /// cannot be read, more than 10000 rules.
  bool set(const std::string& name, int id, bool is_pattern, const std::vector<std::string>& names);
  int of(const std::string& name) const;
  /// Of many, quickly.
  std::vector<int> of(const std::vector<std::string>& names) const;
  /// Grows with every change.
  std::uint64_t version() const;

 private:
  struct Rule {
    std::string name;
    std::shared_ptr<const NamePattern> pattern;  ///< nullptr: the name itself
    int id = 0;
  };
  int found(const std::string& name) const;

  bool by_names_;
  mutable std::mutex mutex_;
  std::vector<Rule> patterns_;          ///< in the order in which they were given
  std::map<std::string, int> by_name_;  ///< of plain names, until a pattern that matches comes
  std::uint64_t version_ = 0;
};

}  // namespace tileflight::simulator
