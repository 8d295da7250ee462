#include "tileflight/core/alignment/regions.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/geometry/json_numbers.h"

namespace tileflight::alignment {

using geometry::Box3;
using geometry::Vec3;
using nlohmann::json;

namespace {

json boxes_json(const std::vector<Box3>& boxes) {
  json list = json::array();
  for (const Box3& box : boxes)
    list.push_back({{"center", geometry::json_numbers(box.center())}, {"size", geometry::json_numbers(box.sizes())}});
  return list;
}

Vec3 vector_of(const json& box, const char* key, const std::string& where) {
  const json& v = box.is_object() && box.contains(key) ? box[key] : json();
  const auto is_number = [](const json& x) { return x.is_number() && std::isfinite(x.get<double>()); };
  if (!v.is_array() || v.size() != 3 || !std::all_of(v.begin(), v.end(), is_number))
    throw InputError(where, std::string("a region needs '") + key + "', three numbers");
  return {v[0].get<double>(), v[1].get<double>(), v[2].get<double>()};
}

std::vector<Box3> boxes_of(const json& regions, const char* key, const std::string& where) {
  if (!regions.contains(key)) return {};
  if (!regions[key].is_array()) throw InputError(where, std::string("'") + key + "' must be a list of regions");
  std::vector<Box3> boxes;
  for (const json& box : regions[key]) {
    const Vec3 center = vector_of(box, "center", where), half = 0.5 * vector_of(box, "size", where);
    if (!(half.minCoeff() > 0.0)) throw InputError(where, "the size of a region must be positive");
    boxes.emplace_back(center - half, center + half);
  }
  return boxes;
}

}  // namespace

json to_json(const RegionList& regions) {
  return {{"found", regions.found},
          {"aligned_on", boxes_json(regions.aligned_on)},
          {"held_out", boxes_json(regions.held_out)}};
}

RegionList regions_from_json(const json& regions, const std::string& where) {
  if (!regions.is_object()) throw InputError(where, "'regions' must be an object");
  return {boxes_of(regions, "aligned_on", where), boxes_of(regions, "held_out", where),
          regions.contains("found") && regions["found"].is_boolean() && regions["found"].get<bool>()};
}

}  // namespace tileflight::alignment
