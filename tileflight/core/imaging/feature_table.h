#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <map>
#include <string>
#include <vector>

namespace tileflight::imaging {

/// Feature id of a vertex that belongs to no feature.
inline constexpr std::uint32_t kNoFeature = std::numeric_limits<std::uint32_t>::max();

/// Properties of the features (buildings, trees, …) that parts of a mesh belong to.
struct FeatureTable {
  std::size_t count = 0;
  std::map<std::string, std::vector<std::string>> properties;  ///< `count` values each, as text

  /// The feature's name: its value of the first existing property among "name", "Name", "gml:name", "gml_id", "gml:id"
  /// and "id"; otherwise its number.
  std::string name(std::uint32_t feature) const {
    for (const char* key : {"name", "Name", "gml:name", "gml_id", "gml:id", "id"}) {
      const auto values = properties.find(key);
      if (values != properties.end() && feature < values->second.size() && !values->second[feature].empty()) {
        return values->second[feature];
      }
    }
    return std::to_string(feature);
  }
};

}  // namespace tileflight::imaging
