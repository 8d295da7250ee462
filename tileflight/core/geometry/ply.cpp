#include "tileflight/core/geometry/ply.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <optional>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/text_parsing.h"

namespace tileflight::geometry {
namespace {

static_assert(std::endian::native == std::endian::little, "binary point files are read on little-endian machines");

std::optional<PlyType> type_of(std::string_view name) {
  struct Named {
    std::string_view old_name, new_name;
    PlyType type;
  };
  static constexpr Named kTypes[] = {
      {"char", "int8", PlyType::kInt8},        {"uchar", "uint8", PlyType::kUint8},
      {"short", "int16", PlyType::kInt16},     {"ushort", "uint16", PlyType::kUint16},
      {"int", "int32", PlyType::kInt32},       {"uint", "uint32", PlyType::kUint32},
      {"float", "float32", PlyType::kFloat32}, {"double", "float64", PlyType::kFloat64},
  };
  for (const Named& named : kTypes) {
    if (name == named.old_name || name == named.new_name) return named.type;
  }
  return std::nullopt;
}

std::size_t size_of(PlyType type) {
  switch (type) {
    case PlyType::kInt8:
    case PlyType::kUint8:
      return 1;
    case PlyType::kInt16:
    case PlyType::kUint16:
      return 2;
    case PlyType::kInt32:
    case PlyType::kUint32:
    case PlyType::kFloat32:
      return 4;
    case PlyType::kFloat64:
      return 8;
  }
  return 1;
}

template <typename Number>
double number_at(const char* bytes, bool swap) {
  char raw[sizeof(Number)];
  for (std::size_t i = 0; i < sizeof(Number); ++i) raw[i] = bytes[swap ? sizeof(Number) - 1 - i : i];
  Number value;
  std::memcpy(&value, raw, sizeof(Number));
  return static_cast<double>(value);
}

double binary_number(const char* bytes, PlyType type, bool swap) {
  switch (type) {
    case PlyType::kInt8:
      return number_at<std::int8_t>(bytes, swap);
    case PlyType::kUint8:
      return number_at<std::uint8_t>(bytes, swap);
    case PlyType::kInt16:
      return number_at<std::int16_t>(bytes, swap);
    case PlyType::kUint16:
      return number_at<std::uint16_t>(bytes, swap);
    case PlyType::kInt32:
      return number_at<std::int32_t>(bytes, swap);
    case PlyType::kUint32:
      return number_at<std::uint32_t>(bytes, swap);
    case PlyType::kFloat32:
      return number_at<float>(bytes, swap);
    case PlyType::kFloat64:
      return number_at<double>(bytes, swap);
  }
  return 0.0;
}

PlyType parse_type(std::string_view name, const std::string& where) {
  const auto type = type_of(name);
  if (!type) throw InputError(where, "'" + std::string(name) + "' is not a PLY number type");
  return *type;
}

PlyFormat parse_format(const std::vector<std::string_view>& fields, const std::string& where) {
  if (fields.size() == 3 && fields[2] == "1.0") {
    if (fields[1] == "ascii") return PlyFormat::kAscii;
    if (fields[1] == "binary_little_endian") return PlyFormat::kLittleEndian;
    if (fields[1] == "binary_big_endian") return PlyFormat::kBigEndian;
  }
  throw InputError(where, "the format must be ascii, binary_little_endian or binary_big_endian 1.0");
}

PlyElement parse_element(const std::vector<std::string_view>& fields, const std::string& where) {
  const auto count = fields.size() == 3 ? base::parse_number<std::uint64_t>(fields[2]) : std::nullopt;
  if (!count) throw InputError(where, "expected 'element NAME COUNT'");
  return {std::string(fields[1]), *count, {}};
}

PlyProperty parse_property(const std::vector<std::string_view>& fields, const std::string& where) {
  if (fields.size() == 5 && fields[1] == "list") {
    return {std::string(fields[4]), parse_type(fields[3], where), true, parse_type(fields[2], where)};
  }
  if (fields.size() != 3) throw InputError(where, "expected 'property TYPE NAME' or 'property list TYPE TYPE NAME'");
  return {std::string(fields[2]), parse_type(fields[1], where), false, PlyType::kUint8};
}

/// Minimum size in bytes of a row of this element.
std::uint64_t least_row_bytes(const PlyElement& element, PlyFormat format) {
  if (format == PlyFormat::kAscii) return 2 * element.properties.size();  // a digit and a separator each
  return ply_row_bytes(element);
}

/// Reads the numbers of the body in order, in either encoding.
class BodyReader {
 public:
  BodyReader(std::string_view body, PlyFormat format) : rest_(body), format_(format) {}

  /// nullopt at the end of the body or (ascii) at the end of the row or if the field is not a number.
  std::optional<double> next(PlyType type) {
    if (format_ == PlyFormat::kAscii) return base::parse_number<double>(base::take_field(row_));
    if (rest_.size() < size_of(type)) return std::nullopt;
    const double value = binary_number(rest_.data(), type, format_ == PlyFormat::kBigEndian);
    rest_.remove_prefix(size_of(type));
    return value;
  }

  /// An ascii row is a line; blank lines are skipped.
  void begin_row() {
    if (format_ != PlyFormat::kAscii) return;
    do {
      row_ = base::take_line(rest_).value_or("");
    } while (row_.find_first_not_of(" \t") == std::string_view::npos && !rest_.empty());
  }

  bool row_has_more() { return format_ == PlyFormat::kAscii && !base::take_field(row_).empty(); }

  /// Upper bound of the numbers left in this row.
  std::uint64_t bytes_left() const { return format_ == PlyFormat::kAscii ? row_.size() : rest_.size(); }

 private:
  std::string_view rest_;
  std::string_view row_;
  PlyFormat format_;
};

/// Reads a property's numbers into `values`; false when they are missing or malformed.
bool read_values(BodyReader& reader, const PlyProperty& property, std::vector<double>& values) {
  double count = 1.0;
  if (property.is_list) count = reader.next(property.count_type).value_or(-1.0);
  if (!(count >= 0.0) || count != std::floor(count) || count > static_cast<double>(reader.bytes_left())) return false;
  values.resize(static_cast<std::size_t>(count));
  for (double& value : values) {
    const auto number = reader.next(property.type);
    if (!number) return false;
    value = *number;
  }
  return true;
}

void read_element(BodyReader& reader, const PlyElement& element, const std::string& file, const PlyVisitor* visit) {
  std::vector<double> values;
  const auto fail = [&](std::uint64_t row, const std::string& what) {
    throw InputError(file, element.name + " " + std::to_string(row) + " of " + std::to_string(element.count) + what);
  };
  for (std::uint64_t row = 0; row < element.count; ++row) {
    reader.begin_row();
    for (std::size_t p = 0; p < element.properties.size(); ++p) {
      if (!read_values(reader, element.properties[p], values)) {
        fail(row, ": the file ends or the value of '" + element.properties[p].name + "' is malformed");
      }
      if (visit != nullptr) (*visit)(row, p, values);
    }
    if (reader.row_has_more()) fail(row, " has more values than the header declares");
  }
}

}  // namespace

std::size_t ply_row_bytes(const PlyElement& element) {
  std::size_t bytes = 0;
  for (const PlyProperty& p : element.properties) bytes += size_of(p.is_list ? p.count_type : p.type);
  return bytes;
}

const PlyElement* PlyHeader::find(std::string_view element) const {
  for (const PlyElement& e : elements) {
    if (e.name == element) return &e;
  }
  return nullptr;
}

PlyHeader parse_ply_header(std::string_view bytes, const std::string& file) {
  PlyHeader header;
  std::string_view rest = bytes;
  if (base::take_line(rest).value_or("") != "ply")
    throw InputError(file, "is not a PLY file: it does not start with 'ply'");
  bool format_known = false;
  for (int line_number = 2;; ++line_number) {
    const std::string where = file + ", line " + std::to_string(line_number);
    const auto line = base::take_line(rest);
    if (!line) throw InputError(file, "the PLY header has no end_header: the file is truncated");
    const auto fields = base::split_fields(*line);
    if (fields.empty() || fields[0] == "comment" || fields[0] == "obj_info") continue;
    if (fields[0] == "end_header") break;
    if (fields[0] == "format") {
      header.format = parse_format(fields, where);
      format_known = true;
    } else if (fields[0] == "element") {
      header.elements.push_back(parse_element(fields, where));
    } else if (fields[0] == "property" && !header.elements.empty()) {
      header.elements.back().properties.push_back(parse_property(fields, where));
    } else {
      throw InputError(where, "'" + std::string(fields[0].substr(0, 40)) + "' is not expected here in a PLY header");
    }
  }
  if (!format_known) throw InputError(file, "the PLY header has no format line");
  header.size_bytes = bytes.size() - rest.size();
  return header;
}

void check_ply_sizes(std::string_view bytes, const PlyHeader& header, const std::string& file) {
  const std::uint64_t body_bytes = bytes.size() - header.size_bytes;
  for (const PlyElement& element : header.elements) {
    // One extra byte: the last line of an ascii file may lack its line end.
    const std::uint64_t row = std::max<std::uint64_t>(least_row_bytes(element, header.format), 1);
    if (element.count > (body_bytes + 1) / row) {
      throw InputError(file, "the header declares " + std::to_string(element.count) + " of element '" + element.name +
                                 "', more than the file can hold: it is truncated or damaged");
    }
  }
}

void visit_ply_element(std::string_view bytes, const PlyHeader& header, std::string_view element,
                       const std::string& file, const PlyVisitor& visit) {
  const std::string_view body = bytes.substr(header.size_bytes);
  check_ply_sizes(bytes, header, file);
  BodyReader reader(body, header.format);
  for (const PlyElement& e : header.elements) {
    const bool wanted = e.name == element;
    read_element(reader, e, file, wanted ? &visit : nullptr);
    if (wanted) return;
  }
}

namespace {

bool has_list(const PlyElement& element) {
  return std::any_of(element.properties.begin(), element.properties.end(),
                     [](const PlyProperty& p) { return p.is_list; });
}

}  // namespace

std::optional<PlyRows> PlyRows::find(std::string_view bytes, const PlyHeader& header, std::string_view element,
                                     const std::string& file) {
  if (header.format == PlyFormat::kAscii) return std::nullopt;
  std::uint64_t at = header.size_bytes;
  for (const PlyElement& e : header.elements) {
    if (has_list(e)) return std::nullopt;
    PlyRows rows;
    for (const PlyProperty& p : e.properties) {
      rows.properties_.push_back({rows.row_bytes_, p.type});
      rows.row_bytes_ += size_of(p.type);
    }
    // The counts were checked against the file's size, so this does not overflow.
    if (rows.row_bytes_ * e.count > bytes.size() - at)
      throw InputError(file, "the file ends within element '" + e.name + "'");
    rows.first_ = bytes.data() + at;
    rows.count_ = e.count;
    rows.swap_ = header.format == PlyFormat::kBigEndian;
    if (e.name == element) return rows;
    at += rows.row_bytes_ * e.count;
  }
  return std::nullopt;
}

double PlyRows::value(std::uint64_t row, std::size_t property) const {
  const PropertyOffset& place = properties_[property];
  return binary_number(first_ + row * row_bytes_ + place.offset, place.type, swap_);
}

}  // namespace tileflight::geometry
