#pragma once

#include <map>
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

}  // namespace tileflight::tiles
