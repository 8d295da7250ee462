#pragma once

#include <cstddef>
#include <map>
#include <span>
#include <string>
#include <vector>

namespace tileflight::tiles {

/// Gathers `asset.copyright` texts. A text names several holders parted by semicolons (as Google's tiles do).
class Attribution {
 public:
  void add(const std::string& copyright);

  /// Distinct holders, most frequent first; equally frequent ones in alphabetical order.
  std::vector<std::string> sorted() const;

 private:
  std::map<std::string, int> counts_;
};

/// asset.copyright of each glTF in a tile's content, of whatever format: its GLBs are looked for, and nothing else in
/// it is read. What is broken has none.
std::vector<std::string> copyrights_in(std::span<const std::byte> content);

}  // namespace tileflight::tiles
