#include "tileflight/tiles/tile_content/metadata_schema.h"

#include <algorithm>

#include "tileflight/core/base/input_error.h"
#include "tileflight/tiles/tile_content/json_reader.h"

namespace tileflight::tile_content {
namespace {

using Enums = std::map<std::string, std::pair<std::string, std::map<std::int64_t, std::string>>>;

Enums parse_enums(const Json& schema, const std::string& where) {
  Enums enums;
  const Json* list = find_object(schema, "enums", where);
  if (list == nullptr) return enums;
  for (const auto& [id, json] : list->items()) {
    const std::string here = where + ": enum " + id;
    auto& [value_type, names] = enums[id];
    value_type = find_string(json, "valueType", here).value_or("UINT16");
    if (component_size_bytes(value_type) == 0) throw InputError(here, "valueType '" + value_type + "' is unknown");
    const Json* values = find_array(json, "values", here);
    if (values == nullptr) throw InputError(here, "values are missing");
    for (const Json& value : *values) {
      const double number = require_value(find_number(value, "value", here), "value", here);
      names[static_cast<std::int64_t>(number)] = require_value(find_string(value, "name", here), "name", here);
    }
  }
  return enums;
}

/// `offset` or `scale`: a number, or nested arrays of them for vectors and arrays.
void append_numbers(const Json& json, const std::string& where, std::vector<double>& out) {
  if (json.is_array()) {
    for (const Json& element : json) append_numbers(element, where, out);
  } else if (json.is_number()) {
    out.push_back(json.get<double>());
  } else {
    throw InputError(where, "offset or scale is not a number");
  }
}

std::vector<double> factors(const Json& json, const char* key, const MetadataProperty& property,
                            const std::string& where) {
  std::vector<double> out;
  if (const Json* value = find_member(json, key)) append_numbers(*value, where, out);
  if (!out.empty() && out.size() != property.fixed_components()) {
    throw InputError(where, std::string(key) + " must have as many numbers as a value");
  }
  return out;
}

MetadataProperty parse_property(const std::string& id, const Json& json, const Enums& enums, const std::string& where) {
  MetadataProperty out;
  out.id = id;
  if (!json.is_object()) throw InputError(where, "is not an object");
  out.semantic = find_string(json, "semantic", where).value_or("");
  const std::string type = require_value(find_string(json, "type", where), "type", where);
  out.is_array = find_bool(json, "array", where).value_or(false);
  out.array_length = find_index(json, "count", where, 1 << 20).value_or(0);
  out.normalized = find_bool(json, "normalized", where).value_or(false);
  if (type == "STRING") {
    out.kind = MetadataProperty::Kind::kString;
  } else if (type == "BOOLEAN") {
    out.kind = MetadataProperty::Kind::kBoolean;
  } else if (type == "ENUM") {
    out.kind = MetadataProperty::Kind::kEnum;
    const std::string name = require_value(find_string(json, "enumType", where), "enumType", where);
    const auto it = enums.find(name);
    if (it == enums.end()) throw InputError(where, "enumType '" + name + "' is not in the schema");
    std::tie(out.component_type, out.enum_names) = it->second;
  } else {
    out.components = component_count(type, where);
    out.component_type = require_value(find_string(json, "componentType", where), "componentType", where);
    if (component_size_bytes(out.component_type) == 0) {
      throw InputError(where, "componentType '" + out.component_type + "' is unknown");
    }
    out.offset = factors(json, "offset", out, where);
    out.scale = factors(json, "scale", out, where);
  }
  return out;
}

}  // namespace

const MetadataProperty* MetadataClass::find(const std::string& id) const {
  const auto it = std::find_if(properties.begin(), properties.end(), [&](const auto& p) { return p.id == id; });
  return it == properties.end() ? nullptr : &*it;
}

std::size_t component_size_bytes(const std::string& type) {
  static const std::map<std::string, std::size_t> kBytes = {{"INT8", 1},    {"UINT8", 1},  {"INT16", 2}, {"UINT16", 2},
                                                            {"INT32", 4},   {"UINT32", 4}, {"INT64", 8}, {"UINT64", 8},
                                                            {"FLOAT32", 4}, {"FLOAT64", 8}};
  const auto it = kBytes.find(type);
  return it == kBytes.end() ? 0 : it->second;
}

MetadataSchema parse_metadata_schema(const Json& schema, const std::string& where) {
  MetadataSchema out;
  const Enums enums = parse_enums(schema, where);
  const Json* classes = find_object(schema, "classes", where);
  if (classes == nullptr) return out;
  for (const auto& [class_id, json] : classes->items()) {
    const std::string in_class = where + ": class " + class_id;
    MetadataClass& metadata_class = out[class_id];
    const Json* properties = find_object(json, "properties", in_class);
    if (properties == nullptr) continue;
    for (const auto& [id, property] : properties->items()) {
      metadata_class.properties.push_back(parse_property(id, property, enums, in_class + ": property " + id));
    }
  }
  return out;
}

std::size_t component_count(const std::string& type, const std::string& where) {
  static const std::map<std::string, std::size_t> kCounts = {{"SCALAR", 1}, {"VEC2", 2}, {"VEC3", 3}, {"VEC4", 4},
                                                             {"MAT2", 4},   {"MAT3", 9}, {"MAT4", 16}};
  const auto it = kCounts.find(type);
  if (it == kCounts.end()) throw InputError(where, "type '" + type + "' is unknown");
  return it->second;
}

}  // namespace tileflight::tile_content
