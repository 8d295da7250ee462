#include "tileflight/tiles/tileset/tile_semantics.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "tileflight/core/base/input_error.h"

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

namespace {

using geometry::Vec3;

std::optional<double> one_number(const SemanticValues& values, const std::string& semantic, const std::string& where) {
  const auto numbers = values.numbers(semantic);
  if (!numbers) return std::nullopt;
  if (numbers->size() != 1 || !std::isfinite((*numbers)[0])) throw InputError(where, semantic + " is not a number");
  return (*numbers)[0];
}

std::optional<BoundingVolume> volume_of(const std::string& prefix, const SemanticValues& values,
                                        const std::string& where) {
  const auto read = [&](const char* kind, std::size_t count) {
    const auto numbers = values.numbers(prefix + kind);
    const bool usable =
        !numbers || (numbers->size() == count &&
                     std::all_of(numbers->begin(), numbers->end(), [](double v) { return std::isfinite(v); }));
    if (!usable) throw InputError(where, prefix + kind + " is not " + std::to_string(count) + " finite numbers");
    return numbers;
  };
  if (const auto v = read("_BOUNDING_BOX", 12)) return parse_box(*v);
  if (const auto v = read("_BOUNDING_REGION", 6)) return parse_region(*v, where);
  if (const auto v = read("_BOUNDING_SPHERE", 4)) return parse_sphere(*v, where);
  return std::nullopt;
}

std::optional<S2Cell> s2_cell_of(const std::string& semantic, const SemanticValues& values, const std::string& where) {
  const auto text = values.text(semantic);
  if (!text) return std::nullopt;
  std::uint64_t id = 0;
  const auto [end, error] = std::from_chars(text->data(), text->data() + text->size(), id);
  const bool is_number = error == std::errc() && end == text->data() + text->size();
  const std::optional<S2Cell> cell = is_number ? s2_cell_from_id(id) : std::nullopt;
  if (!cell) throw InputError(where, semantic + " is not an S2 cell");
  return cell;
}

}  // namespace

OrientedBox parse_box(const std::vector<double>& v) {
  OrientedBox box;
  box.center = Vec3(v[0], v[1], v[2]);
  box.half_axes << v[3], v[6], v[9], v[4], v[7], v[10], v[5], v[8], v[11];
  return box;
}

BoundingSphere parse_sphere(const std::vector<double>& v, const std::string& where) {
  if (v[3] < 0) throw InputError(where, "the radius of the bounding sphere is negative");
  return {Vec3(v[0], v[1], v[2]), v[3]};
}

GeographicRegion parse_region(const std::vector<double>& v, const std::string& where) {
  constexpr double kRounding_rad = 1e-6;
  constexpr double kPole_rad = std::numbers::pi / 2;
  constexpr double kMeridian_rad = std::numbers::pi;
  const auto within = [](double value, double limit) { return std::abs(value) <= limit + kRounding_rad; };
  if (!within(v[0], kMeridian_rad) || !within(v[2], kMeridian_rad) || !within(v[1], kPole_rad) ||
      !within(v[3], kPole_rad)) {
    throw InputError(where, "boundingVolume.region has an angle outside of its range (radians, west south east north)");
  }
  if (v[1] > v[3] || v[4] > v[5]) {
    throw InputError(where,
                     "boundingVolume.region has its south above its north, or its minimum height above its maximum");
  }
  return {v[0], std::max(v[1], -kPole_rad), v[2], std::min(v[3], kPole_rad), v[4], v[5]};
}

TileSemantics read_semantics(const std::string& prefix, const SemanticValues& values, const std::string& where) {
  TileSemantics out;
  out.bounding_volume = volume_of(prefix, values, where);
  out.s2_cell = s2_cell_of(prefix + "_BOUNDING_S2_CELL", values, where);
  out.min_height_m = one_number(values, prefix + "_MINIMUM_HEIGHT", where);
  out.max_height_m = one_number(values, prefix + "_MAXIMUM_HEIGHT", where);
  if (prefix == "CONTENT") {
    out.uri = values.text("CONTENT_URI");
    return out;
  }
  out.has_transform = values.numbers("TILE_TRANSFORM").has_value();
  out.geometric_error_m = one_number(values, "TILE_GEOMETRIC_ERROR", where);
  if (out.geometric_error_m.value_or(0) < 0) throw InputError(where, "TILE_GEOMETRIC_ERROR is negative");
  if (const auto refine = one_number(values, "TILE_REFINE", where)) {
    if (*refine != 0 && *refine != 1) throw InputError(where, "TILE_REFINE must be 0 (ADD) or 1 (REPLACE)");
    out.refine = *refine == 0 ? Refine::kAdd : Refine::kReplace;
  }
  return out;
}

BoundingVolume apply_semantics(const BoundingVolume& volume, const TileSemantics& semantics) {
  BoundingVolume out = semantics.bounding_volume.value_or(volume);
  const auto set_heights = [&](auto& earth_fixed) {
    earth_fixed.min_height_m = semantics.min_height_m.value_or(earth_fixed.min_height_m);
    earth_fixed.max_height_m = semantics.max_height_m.value_or(earth_fixed.max_height_m);
  };
  const auto heights = height_range(out);
  const bool has_heights = heights || (semantics.min_height_m && semantics.max_height_m);
  if (semantics.s2_cell && has_heights) {
    const auto [low_m, high_m] = heights.value_or(std::pair{0.0, 0.0});
    out = S2Volume{*semantics.s2_cell, low_m, high_m};
  }
  if (auto* region = std::get_if<GeographicRegion>(&out)) set_heights(*region);
  if (auto* s2 = std::get_if<S2Volume>(&out)) set_heights(*s2);
  return out;
}

std::optional<std::pair<double, double>> height_range(const BoundingVolume& volume) {
  if (const auto* region = std::get_if<GeographicRegion>(&volume)) {
    return std::pair{region->min_height_m, region->max_height_m};
  }
  if (const auto* s2 = std::get_if<S2Volume>(&volume)) return std::pair{s2->min_height_m, s2->max_height_m};
  return std::nullopt;
}

}  // namespace tileflight::tileset
