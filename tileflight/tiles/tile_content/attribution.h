#pragma once

#include <cstddef>
#include <map>
#include <span>
#include <string>
#include <vector>

namespace tileflight::tile_content {

/// Collects `asset.copyright` texts. A text may name several holders separated by semicolons (as in Google's tiles).
class AttributionCollector {
 public:
  void add(const std::string& copyright);

  /// Returns the distinct holders, most frequent first; equally frequent ones are in alphabetical order.
  std::vector<std::string> sorted_holders() const;

 private:
  std::map<std::string, int> counts_;
};

/// Returns the asset.copyright of each glTF in a tile's content of any format. It locates and reads only embedded GLBs;
/// broken data gives none.
std::vector<std::string> find_copyrights(std::span<const std::byte> content);

}  // namespace tileflight::tile_content
