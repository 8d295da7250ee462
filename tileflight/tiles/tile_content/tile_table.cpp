#include "tileflight/tiles/tile_content/tile_table.h"

#include <algorithm>
#include <map>
#include <string_view>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/raw_bytes.h"
#include "tileflight/core/base/text_parsing.h"

namespace tileflight::tile_content {

using Bytes = std::span<const std::byte>;

Bytes trim_to_byte_length(Bytes bytes, std::size_t header_bytes, const std::string& name) {
  if (bytes.size() < header_bytes) {
    throw InputError(name, "truncated: " + std::to_string(bytes.size()) + " bytes, but the header alone has " +
                               std::to_string(header_bytes));
  }
  const std::uint32_t length = base::read_raw<std::uint32_t>(bytes, 8);
  if (length > bytes.size()) {
    throw InputError(name, "truncated: " + std::to_string(bytes.size()) + " of " + std::to_string(length) + " bytes");
  }
  if (length < header_bytes)
    throw InputError(name, "its header gives a length of " + std::to_string(length) + " bytes");
  return bytes.first(length);
}

void require_version(Bytes bytes, std::uint32_t expected, const std::string& kind, const std::string& name) {
  const std::uint32_t version = base::read_raw<std::uint32_t>(bytes, 4);
  if (version != expected) {
    throw InputError(
        name, kind + " version " + std::to_string(version) + " is not supported, only " + std::to_string(expected));
  }
}

TileTableLengths read_table_lengths(Bytes tile, std::size_t header_bytes) {
  return {header_bytes, base::read_raw<std::uint32_t>(tile, 12), base::read_raw<std::uint32_t>(tile, 16),
          base::read_raw<std::uint32_t>(tile, 20), base::read_raw<std::uint32_t>(tile, 24)};
}

TileTables split_tables(Bytes tile, const TileTableLengths& lengths, const std::string& name) {
  // Sums of five 32-bit numbers in 64 bits: no overflow.
  const std::size_t end =
      lengths.header + lengths.feature_json + lengths.feature_binary + lengths.batch_json + lengths.batch_binary;
  if (end > tile.size()) throw InputError(name, "its tables reach beyond the end of the file");
  Bytes rest = tile.subspan(lengths.header);
  const auto take = [&](std::size_t length) {
    const Bytes part = rest.first(length);
    rest = rest.subspan(length);
    return part;
  };
  TileTables tables;
  tables.feature_json = take(lengths.feature_json);
  tables.feature_binary = take(lengths.feature_binary);
  tables.batch_json = take(lengths.batch_json);
  tables.batch_binary = take(lengths.batch_binary);
  tables.body = rest;
  return tables;
}

namespace {

Json parse(Bytes json, const std::string& where) {
  const std::string_view text(reinterpret_cast<const char*>(json.data()), json.size());
  // The text may consist only of padding to eight bytes.
  if (text.find_first_not_of(std::string_view(" \t\r\n\0", 5)) == std::string_view::npos) return Json::object();
  Json out = parse_json(text.substr(0, text.find('\0')), where, {.max_depth = 64});
  if (!out.is_object()) throw InputError(where, "is not a JSON object");
  return out;
}

std::string text_of(const Json& value) {
  if (value.is_string()) return value.get<std::string>();
  return value.is_null() ? "" : value.dump(-1, ' ', false, Json::error_handler_t::replace);
}

template <class T>
std::string number_text(Bytes bytes, std::size_t index) {
  std::string text;
  base::append_number(text, base::read_raw<T>(bytes, index * sizeof(T)));
  return text;
}

/// Size and type of a component type in 3D Tiles 1.0 tables.
struct Component {
  std::size_t bytes;
  std::string (*text)(Bytes bytes, std::size_t index);
};

const Component* component_of(const std::string& type) {
  static const std::map<std::string, Component> kComponents = {
      {"BYTE", {1, number_text<std::int8_t>}},   {"UNSIGNED_BYTE", {1, number_text<std::uint8_t>}},
      {"SHORT", {2, number_text<std::int16_t>}}, {"UNSIGNED_SHORT", {2, number_text<std::uint16_t>}},
      {"INT", {4, number_text<std::int32_t>}},   {"UNSIGNED_INT", {4, number_text<std::uint32_t>}},
      {"FLOAT", {4, number_text<float>}},        {"DOUBLE", {8, number_text<double>}}};
  const auto it = kComponents.find(type);
  return it == kComponents.end() ? nullptr : &it->second;
}

std::size_t batch_components(const std::string& type, const std::string& where) {
  if (type == "SCALAR") return 1;
  if (type.size() == 4 && type.starts_with("VEC") && type[3] >= '2' && type[3] <= '4') {
    return static_cast<std::size_t>(type[3] - '0');
  }
  throw InputError(where, "type '" + type + "' is unknown");
}

/// One property of a batch table from the binary part.
std::vector<std::string> binary_column(const Json& reference, Bytes binary, std::size_t count,
                                       const std::string& where) {
  const std::size_t offset = require_value(find_index(reference, "byteOffset", where), "byteOffset", where);
  const std::string type = require_value(find_string(reference, "componentType", where), "componentType", where);
  const Component* component = component_of(type);
  if (component == nullptr) throw InputError(where, "componentType '" + type + "' is unknown");
  const std::size_t components = batch_components(find_string(reference, "type", where).value_or("SCALAR"), where);
  if (offset > binary.size() || count > (binary.size() - offset) / (component->bytes * components)) {
    throw InputError(where, "lies outside the table's binary part");
  }
  std::vector<std::string> out(count);
  for (std::size_t i = 0; i < count * components; ++i) {
    if (i % components > 0) out[i / components] += ' ';
    out[i / components] += component->text(binary.subspan(offset), i);
  }
  return out;
}

}  // namespace

TileTable::TileTable(Bytes json, Bytes binary, const std::string& where)
    : json_(parse(json, where)), binary_(binary), where_(where) {}

Bytes TileTable::binary_part(const Json& reference, const char* key, std::size_t count, std::size_t bytes_each) const {
  const std::string where = where_ + ": " + key;
  const std::size_t offset = require_value(find_index(reference, "byteOffset", where), "byteOffset", where);
  if (offset > binary_.size() || count > (binary_.size() - offset) / bytes_each) {
    throw InputError(where, "lies outside the table's binary part");
  }
  return binary_.subspan(offset, count * bytes_each);
}

std::optional<std::size_t> TileTable::count(const char* key) const {
  const Json* member = find_member(json_, key);
  if (member == nullptr || !member->is_object()) return find_index(json_, key, where_, 0xFFFFFFFF);
  return base::read_raw<std::uint32_t>(binary_part(*member, key, 1, sizeof(std::uint32_t)), 0);
}

geometry::Vec3 TileTable::rtc_center() const {
  const auto center = global("RTC_CENTER", 3);
  return center ? geometry::Vec3((*center)[0], (*center)[1], (*center)[2]) : geometry::Vec3::Zero();
}

TileTable::QuantizedPositions TileTable::quantized_positions(std::size_t count) const {
  auto numbers = values<std::uint16_t>("POSITION_QUANTIZED", 3 * count);
  if (!numbers) throw InputError(where_, "has no POSITION and no POSITION_QUANTIZED");
  auto scale = require_value(global("QUANTIZED_VOLUME_SCALE", 3), "QUANTIZED_VOLUME_SCALE", where_);
  auto offset = require_value(global("QUANTIZED_VOLUME_OFFSET", 3), "QUANTIZED_VOLUME_OFFSET", where_);
  return {*std::move(numbers), std::move(scale), std::move(offset)};
}

std::optional<std::vector<double>> TileTable::global(const char* key, std::size_t components) const {
  const auto floats = values<float>(key, components);
  if (!floats) return std::nullopt;
  if (find_member(json_, key)->is_array()) return find_numbers(json_, key, components, where_);  // not rounded to float
  return std::vector<double>(floats->begin(), floats->end());
}

std::optional<std::vector<std::uint32_t>> TileTable::ids(const char* key, std::size_t count) const {
  const Json* member = find_member(json_, key);
  if (member == nullptr) return std::nullopt;
  const std::string type = find_string(*member, "componentType", where_).value_or("UNSIGNED_SHORT");
  const auto widened = [&]<class T>(T) {
    const std::vector<T> narrow = *values<T>(key, count);
    return std::vector<std::uint32_t>(narrow.begin(), narrow.end());
  };
  if (type == "UNSIGNED_BYTE") return widened(std::uint8_t{});
  if (type == "UNSIGNED_INT") return widened(std::uint32_t{});
  if (type == "UNSIGNED_SHORT") return widened(std::uint16_t{});
  throw InputError(where_ + ": " + key, "componentType '" + type + "' cannot be the type of an id");
}

std::shared_ptr<const imaging::FeatureTable> read_batch_table(Bytes json, Bytes binary, std::size_t count,
                                                              const std::string& where) {
  const Json table = parse(json, where);
  auto out = std::make_shared<imaging::FeatureTable>();
  out->count = count;
  for (const auto& [key, value] : table.items()) {
    const std::string here = where + ": " + key;
    if (key == "extensions" || key == "extras" || key == "HIERARCHY") continue;
    if (value.is_array()) {
      // An array of the wrong length is read as far as possible.
      std::vector<std::string>& texts = out->properties[key];
      for (std::size_t i = 0; i < std::min(count, value.size()); ++i) texts.push_back(text_of(value[i]));
    } else if (value.is_object() && value.contains("byteOffset")) {
      out->properties[key] = binary_column(value, binary, count, here);
    }
  }
  return out->properties.empty() ? nullptr : out;
}

std::shared_ptr<const imaging::FeatureTable> try_read_batch_table(const TileTables& tables, std::size_t count,
                                                                  std::vector<std::string>& warnings) {
  try {
    return read_batch_table(tables.batch_json, tables.batch_binary, count, "batch table");
  } catch (const InputError& error) {
    warn_once(std::string("features have no names: ") + error.what(), warnings);
    return nullptr;
  }
}

void warn_once(const std::string& what, std::vector<std::string>& warnings) {
  if (std::find(warnings.begin(), warnings.end(), what) == warnings.end()) warnings.push_back(what);
}

}  // namespace tileflight::tile_content
