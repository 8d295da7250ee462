#include "tileflight/tiles/tileset/volume_json.h"

#include <nlohmann/json.hpp>

#include "tileflight/core/base/input_error.h"
#include "tileflight/tiles/tileset/tile_semantics.h"

namespace tileflight::tileset {
namespace {

using tile_content::find_number;
using tile_content::find_numbers;
using tile_content::find_object;
using tile_content::find_string;
using tile_content::Json;
using tile_content::require_value;

S2Volume s2_volume_of(const Json& json, const std::string& where) {
  const std::string token = require_value(find_string(json, "token", where), "token", where);
  const std::optional<S2Cell> cell = s2_cell_from_token(token);
  if (!cell) throw InputError(where, "its token '" + token + "' is not an S2 cell");
  const double low_m = require_value(find_number(json, "minimumHeight", where), "minimumHeight", where);
  const double high_m = require_value(find_number(json, "maximumHeight", where), "maximumHeight", where);
  if (low_m > high_m) throw InputError(where, "its minimum height lies above its maximum");
  return {*cell, low_m, high_m};
}

/// Volumes defined by extensions. A cylinder is replaced by its bounding box, which has the same twelve numbers.
std::optional<BoundingVolume> extension_volume(const Json& volume, const std::string& where) {
  const Json* extensions = find_object(volume, "extensions", where);
  if (extensions == nullptr) return std::nullopt;
  if (const Json* s2 = find_object(*extensions, "3DTILES_bounding_volume_S2", where)) {
    return s2_volume_of(*s2, where + ": 3DTILES_bounding_volume_S2");
  }
  const Json* cylinder = find_object(*extensions, "3DTILES_bounding_volume_cylinder", where);
  const auto v = cylinder == nullptr ? std::nullopt : find_numbers(*cylinder, "cylinder", 12, where);
  return v ? std::optional(parse_box(*v)) : std::nullopt;
}

}  // namespace

std::optional<BoundingVolume> parse_volume(const Json& parent, const std::string& where, const char* key) {
  const Json* json = find_object(parent, key, where);
  if (json == nullptr) return std::nullopt;
  std::optional<BoundingVolume> plain;
  if (const auto v = find_numbers(*json, "sphere", 4, where)) plain = parse_sphere(*v, where);
  if (const auto v = find_numbers(*json, "region", 6, where)) plain = parse_region(*v, where);
  if (const auto v = find_numbers(*json, "box", 12, where)) plain = parse_box(*v);
  const std::optional<BoundingVolume> extended = extension_volume(*json, where);
  return extended ? extended : plain;
}

}  // namespace tileflight::tileset
