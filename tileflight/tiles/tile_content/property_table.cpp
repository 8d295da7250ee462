#include "tileflight/tiles/tile_content/property_table.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <variant>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/raw_bytes.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/tiles/tile_content/json_reader.h"

namespace tileflight::tile_content {
namespace {

using Kind = MetadataProperty::Kind;
using Number = std::variant<std::int64_t, std::uint64_t, double>;

template <class T>
T load(std::span<const std::byte> bytes, std::size_t index) {
  return base::read_raw<T>(bytes, index * sizeof(T));
}

/// Reads a stored component. The caller must have checked the bounds.
Number number_at(std::span<const std::byte> bytes, const std::string& type, std::size_t i) {
  if (type == "INT8") return std::int64_t{load<std::int8_t>(bytes, i)};
  if (type == "UINT8") return std::uint64_t{load<std::uint8_t>(bytes, i)};
  if (type == "INT16") return std::int64_t{load<std::int16_t>(bytes, i)};
  if (type == "UINT16") return std::uint64_t{load<std::uint16_t>(bytes, i)};
  if (type == "INT32") return std::int64_t{load<std::int32_t>(bytes, i)};
  if (type == "UINT32") return std::uint64_t{load<std::uint32_t>(bytes, i)};
  if (type == "INT64") return load<std::int64_t>(bytes, i);
  if (type == "UINT64") return load<std::uint64_t>(bytes, i);
  if (type == "FLOAT32") return double{load<float>(bytes, i)};
  return load<double>(bytes, i);
}

double to_double(const Number& number) {
  return std::visit([](auto value) { return static_cast<double>(value); }, number);
}

/// Divisor of normalised values (3D Metadata Specification, "Normalized Values").
double normalizer(const std::string& type) {
  const double bits = static_cast<double>(component_size_bytes(type)) * 8 - (type.starts_with("U") ? 0 : 1);
  return std::ldexp(1.0, static_cast<int>(bits)) - 1;
}

std::string number_text(const Number& number) {
  std::string text;
  std::visit([&text](auto value) { base::append_number(text, value); }, number);
  return text;
}

/// Offsets of a column: `count` + 1 unsigned integers that do not decrease.
std::vector<std::size_t> read_offsets(std::span<const std::byte> bytes, const std::string& type, std::size_t count,
                                      const std::string& where) {
  const std::size_t size = type.starts_with("UINT") ? component_size_bytes(type) : 0;
  if (size == 0) throw InputError(where, "offset type '" + type + "' is unknown");
  if (bytes.size() / size <= count) throw InputError(where, "its offsets are truncated");
  std::vector<std::size_t> out(count + 1);
  for (std::size_t i = 0; i <= count; ++i) {
    out[i] = static_cast<std::size_t>(std::get<std::uint64_t>(number_at(bytes, type, i)));
    if (i > 0 && out[i] < out[i - 1]) throw InputError(where, "its offsets decrease");
  }
  return out;
}

void require_bytes(std::span<const std::byte> values, std::size_t elements, std::size_t bits,
                   const std::string& where) {
  if (elements > std::numeric_limits<std::size_t>::max() / bits - 8 || (elements * bits + 7) / 8 > values.size()) {
    throw InputError(where, "needs " + std::to_string(elements) + " elements, more than its bufferView holds");
  }
}

}  // namespace

PropertyTable::PropertyTable(const Json& json, const MetadataSchema& schema, const View& view,
                             const std::string& where) {
  const std::string name = require_value(find_string(json, "class", where), "class", where);
  const auto metadata_class = schema.find(name);
  if (metadata_class == schema.end()) throw InputError(where, "class '" + name + "' is not in the schema");
  rows_ = require_value(find_index(json, "count", where, std::size_t{1} << 31), "count", where);
  const Json* properties = find_object(json, "properties", where);
  if (properties == nullptr) return;
  for (const auto& [id, column] : properties->items()) {
    const std::string here = where + ": property " + id;
    const MetadataProperty* property = metadata_class->second.find(id);
    if (property == nullptr) throw InputError(here, "does not belong to class '" + name + "'");
    columns_.push_back(read_column(*property, column, view, here));
    properties_.push_back(*property);
  }
}

PropertyTable::Column PropertyTable::read_column(const MetadataProperty& property, const Json& json, const View& view,
                                                 const std::string& where) const {
  Column out;
  const auto bytes_of = [&](const char* key) { return view(require_value(find_index(json, key, where), key, where)); };
  const auto type_of = [&](const char* key) { return find_string(json, key, where).value_or("UINT32"); };
  out.values = bytes_of("values");
  std::size_t elements = rows_;
  if (property.is_array && property.array_length > 0) elements *= property.array_length;
  if (property.is_array && property.array_length == 0) {
    out.array_ends = read_offsets(bytes_of("arrayOffsets"), type_of("arrayOffsetType"), rows_, where);
    elements = out.array_ends.back();
  }
  if (property.kind == Kind::kString) {
    out.string_ends = read_offsets(bytes_of("stringOffsets"), type_of("stringOffsetType"), elements, where);
    require_bytes(out.values, out.string_ends.back(), 8, where);
  } else if (property.kind == Kind::kBoolean) {
    require_bytes(out.values, elements, 1, where);
  } else {
    require_bytes(out.values, elements, 8 * property.components * component_size_bytes(property.component_type), where);
  }
  return out;
}

std::pair<std::size_t, std::size_t> PropertyTable::elements(std::size_t column, std::size_t row) const {
  const MetadataProperty& property = properties_[column];
  if (!property.is_array) return {row, 1};
  if (property.array_length > 0) return {row * property.array_length, property.array_length};
  const std::vector<std::size_t>& ends = columns_[column].array_ends;
  return {ends[row], ends[row + 1] - ends[row]};
}

std::optional<std::vector<double>> PropertyTable::numbers(std::size_t column, std::size_t row) const {
  const MetadataProperty& property = properties_[column];
  if (row >= rows_ || property.kind == Kind::kString || property.kind == Kind::kBoolean) return std::nullopt;
  const auto [first, count] = elements(column, row);
  std::vector<double> out(count * property.components);
  for (std::size_t i = 0; i < out.size(); ++i) {
    double value =
        to_double(number_at(columns_[column].values, property.component_type, first * property.components + i));
    if (property.normalized) value = std::max(value / normalizer(property.component_type), -1.0);
    if (i < property.scale.size()) value *= property.scale[i];
    if (i < property.offset.size()) value += property.offset[i];
    out[i] = value;
  }
  return out;
}

std::string PropertyTable::text(std::size_t column, std::size_t row) const {
  if (row >= rows_) return "";
  const MetadataProperty& property = properties_[column];
  const Column& data = columns_[column];
  const auto [first, count] = elements(column, row);
  const bool plain = !property.normalized && property.scale.empty() && property.offset.empty();
  const std::optional<std::vector<double>> scaled = plain ? std::nullopt : numbers(column, row);
  std::string out;
  for (std::size_t i = 0; i < count * property.components; ++i) {
    const std::size_t at = first * property.components + i;
    if (i > 0) out += ' ';
    if (property.kind == Kind::kString) {
      out.append(reinterpret_cast<const char*>(data.values.data()) + data.string_ends[at],
                 data.string_ends[at + 1] - data.string_ends[at]);
    } else if (property.kind == Kind::kBoolean) {
      out += (std::to_integer<unsigned>(data.values[at / 8]) >> (at % 8) & 1U) != 0 ? "true" : "false";
    } else if (property.kind == Kind::kEnum) {
      const Number number = number_at(data.values, property.component_type, at);
      const auto name = property.enum_names.find(static_cast<std::int64_t>(to_double(number)));
      out += name == property.enum_names.end() ? number_text(number) : name->second;
    } else {
      out += number_text(scaled ? Number((*scaled)[i]) : number_at(data.values, property.component_type, at));
    }
  }
  return out;
}

}  // namespace tileflight::tile_content
