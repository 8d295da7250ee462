#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <optional>

#include "tileflight/core/base/decompress.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/raw_bytes.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/core/geometry/cloud_columns.h"
#include "tileflight/core/geometry/cloud_files.h"

namespace tileflight::geometry {
namespace {

struct PcdField {
  std::string name;
  std::size_t size = 4;   ///< bytes of one number
  char type = 'F';        ///< I, U or F
  std::size_t count = 1;  ///< numbers per point
};

struct PcdHeader {
  std::vector<PcdField> fields;
  std::uint64_t width = 0, height = 1, points = 0;
  PcdEncoding encoding = PcdEncoding::kAscii;
  std::size_t size_bytes = 0;  ///< up to and including the DATA line

  std::size_t point_bytes() const {
    std::size_t bytes = 0;
    for (const PcdField& f : fields) bytes += f.size * f.count;
    return bytes;
  }
};

template <typename Number>
Number parse_or_throw(std::string_view field, const std::string& where) {
  const auto value = base::parse_number<Number>(field);
  if (!value) throw InputError(where, "'" + std::string(field.substr(0, 40)) + "' is not a valid number here");
  return *value;
}

PcdEncoding parse_encoding(std::string_view name, const std::string& where) {
  if (name == "ascii") return PcdEncoding::kAscii;
  if (name == "binary") return PcdEncoding::kBinary;
  if (name == "binary_compressed") return PcdEncoding::kBinaryCompressed;
  throw InputError(where, "DATA must be ascii, binary or binary_compressed");
}

/// Fills one attribute (SIZE, TYPE or COUNT) of every field from its line.
template <typename Set>
void set_each(std::vector<PcdField>& fields, std::vector<std::string_view> values, const std::string& where, Set set) {
  if (values.size() != fields.size()) throw InputError(where, "its number of entries differs from FIELDS");
  for (std::size_t i = 0; i < fields.size(); ++i) set(fields[i], values[i]);
}

/// Applies one line of the header. `values`: the fields after the key.
void apply_pcd_line(PcdHeader& header, std::string_view key, const std::vector<std::string_view>& values,
                    const std::string& where) {
  const auto number = [&] { return parse_or_throw<std::uint64_t>(values.empty() ? "" : values[0], where); };
  if (key == "FIELDS") {
    header.fields.clear();
    for (const auto& name : values) header.fields.push_back({std::string(name), 4, 'F', 1});
  } else if (key == "SIZE") {
    set_each(header.fields, values, where,
             [&](PcdField& f, std::string_view v) { f.size = parse_or_throw<std::size_t>(v, where); });
  } else if (key == "TYPE") {
    set_each(header.fields, values, where, [](PcdField& f, std::string_view v) { f.type = v[0]; });
  } else if (key == "COUNT") {
    set_each(header.fields, values, where,
             [&](PcdField& f, std::string_view v) { f.count = parse_or_throw<std::size_t>(v, where); });
  } else if (key == "WIDTH") {
    header.width = number();
  } else if (key == "HEIGHT") {
    header.height = number();
  } else if (key == "POINTS") {
    header.points = number();
  } else if (key == "DATA") {
    header.encoding = parse_encoding(values.empty() ? "" : values[0], where);
  } else if (key != "VERSION" && key != "VIEWPOINT") {
    throw InputError(where, "'" + std::string(key.substr(0, 40)) + "' is not a key of a PCD header");
  }
}

void check_header(const PcdHeader& header, std::size_t body_bytes, const std::string& file) {
  if (header.fields.empty()) throw InputError(file, "the PCD header has no FIELDS");
  std::uint64_t least_bytes = 0;
  for (const PcdField& f : header.fields) {
    const bool known = f.type == 'F' ? f.size == 4 || f.size == 8
                                     : (f.type == 'I' || f.type == 'U') && std::has_single_bit(f.size) && f.size <= 8;
    if (!known) throw InputError(file, "field '" + f.name + "' has an unknown combination of TYPE and SIZE");
    if (f.count > 1 && f.count > body_bytes)
      throw InputError(file, "field '" + f.name + "' has a COUNT larger than the file");
    least_bytes += header.encoding == PcdEncoding::kBinary ? f.size * f.count : f.count;
  }
  if (header.width != 0 && header.points / header.width != header.height) {
    throw InputError(file, "POINTS must be WIDTH times HEIGHT");
  }
  std::uint64_t most_bytes = body_bytes;
  if (header.encoding == PcdEncoding::kAscii) most_bytes += 1;              // the last line may lack its line end
  if (header.encoding == PcdEncoding::kBinaryCompressed) most_bytes *= 88;  // maximum compression ratio of LZF
  if (header.points > most_bytes / std::max<std::uint64_t>(least_bytes, 1)) {
    throw InputError(file, "POINTS " + std::to_string(header.points) +
                               " is more than the file can hold: it is truncated or damaged");
  }
}

PcdHeader parse_pcd_header(std::string_view bytes, const std::string& file) {
  PcdHeader header;
  std::string_view rest = bytes;
  for (int line_number = 1;; ++line_number) {
    const auto line = base::take_line(rest);
    if (!line) throw InputError(file, "the PCD header has no DATA line: not a PCD file, or truncated");
    auto fields = base::split_fields(*line);
    if (fields.empty() || fields[0].starts_with('#')) continue;
    const std::string_view key = fields[0];
    fields.erase(fields.begin());
    apply_pcd_line(header, key, fields, file + ", line " + std::to_string(line_number));
    if (key == "DATA") break;
  }
  header.size_bytes = bytes.size() - rest.size();
  check_header(header, rest.size(), file);
  return header;
}

bool is_packed_color(const PcdField& f) { return (f.name == "rgb" || f.name == "rgba") && f.size == 4; }

template <typename Number>
double pcd_number_at(const char* bytes) {
  Number value;
  std::memcpy(&value, bytes, sizeof(Number));
  return static_cast<double>(value);
}

double pcd_number(const PcdField& f, const char* bytes) {
  // The bits of a packed colour may be declared as a float.
  if (is_packed_color(f)) return pcd_number_at<std::uint32_t>(bytes);
  if (f.type == 'F') return f.size == 4 ? pcd_number_at<float>(bytes) : pcd_number_at<double>(bytes);
  const bool is_signed = f.type == 'I';
  switch (f.size) {
    case 1:
      return is_signed ? pcd_number_at<std::int8_t>(bytes) : pcd_number_at<std::uint8_t>(bytes);
    case 2:
      return is_signed ? pcd_number_at<std::int16_t>(bytes) : pcd_number_at<std::uint16_t>(bytes);
    case 4:
      return is_signed ? pcd_number_at<std::int32_t>(bytes) : pcd_number_at<std::uint32_t>(bytes);
    default:
      return is_signed ? pcd_number_at<std::int64_t>(bytes) : pcd_number_at<std::uint64_t>(bytes);
  }
}

std::optional<double> text_number(const PcdField& f, std::string_view text) {
  if (!is_packed_color(f)) return base::parse_number<double>(text);
  if (f.type != 'F') return base::parse_number<std::uint32_t>(text);
  const auto packed = base::parse_number<float>(text);
  if (!packed) return std::nullopt;
  return std::bit_cast<std::uint32_t>(*packed);
}

/// The cloud column of each field; fields with several numbers are skipped.
struct Columns {
  std::vector<CloudColumn> columns;
  std::vector<int> column_of_field;  ///< -1: skipped
};

Columns columns_of(const PcdHeader& header) {
  Columns result;
  for (const PcdField& f : header.fields) {
    const bool wanted = f.count == 1 && f.name != "_";  // "_" is padding
    result.column_of_field.push_back(wanted ? static_cast<int>(result.columns.size()) : -1);
    const ColorRange range = f.type == 'F' ? ColorRange::kUnit : f.size == 2 ? ColorRange::kShort : ColorRange::kByte;
    if (wanted) result.columns.push_back({f.name, range});
  }
  return result;
}

void read_ascii(std::string_view body, const PcdHeader& header, const Columns& columns, const std::string& file,
                CloudColumns& cloud) {
  for (std::uint64_t point = 0; point < header.points; ++point) {
    std::string_view line = base::take_line(body).value_or("");
    for (std::size_t f = 0; f < header.fields.size(); ++f) {
      for (std::size_t k = 0; k < header.fields[f].count; ++k) {
        const auto value = text_number(header.fields[f], base::take_field(line));
        if (!value) {
          throw InputError(file, "point " + std::to_string(point) + " of " + std::to_string(header.points) +
                                     ": the file ends or the value of '" + header.fields[f].name + "' is malformed");
        }
        if (columns.column_of_field[f] >= 0)
          cloud.set(static_cast<std::size_t>(columns.column_of_field[f]), point, *value);
      }
    }
  }
}

/// Reads binary data, stored point by point or (compressed) field by field.
void read_binary(std::string_view body, const PcdHeader& header, bool field_after_field, const Columns& columns,
                 CloudColumns& cloud) {
  const std::size_t point_bytes = header.point_bytes();
  std::size_t offset = 0;
  for (std::size_t f = 0; f < header.fields.size(); ++f) {
    const PcdField& field = header.fields[f];
    const std::size_t field_bytes = field.size * field.count;
    const std::size_t first = field_after_field ? offset * header.points : offset;
    const std::size_t stride = field_after_field ? field_bytes : point_bytes;
    const int column = columns.column_of_field[f];
    for (std::uint64_t point = 0; column >= 0 && point < header.points; ++point) {
      const char* bytes = body.data() + first + point * stride;
      cloud.set(static_cast<std::size_t>(column), point, pcd_number(field, bytes));
    }
    offset += field_bytes;
  }
}

std::string expanded_body(std::string_view body, const PcdHeader& header, const std::string& file) {
  std::uint32_t sizes[2] = {0, 0};  // compressed, expanded
  if (body.size() >= sizeof(sizes)) std::memcpy(sizes, body.data(), sizeof(sizes));
  if (body.size() < sizeof(sizes) + sizes[0]) throw InputError(file, "the compressed data is truncated");
  if (sizes[1] != header.points * header.point_bytes()) {
    throw InputError(file, "the size of the compressed data differs from the header's");
  }
  auto expanded = base::lzf_decompress(body.substr(sizeof(sizes), sizes[0]), sizes[1]);
  if (!expanded) throw InputError(file, "the compressed data is damaged");
  return *std::move(expanded);
}

float packed_rgb(const std::array<std::uint8_t, 3>& c) {
  return std::bit_cast<float>(std::uint32_t{c[0]} << 16 | std::uint32_t{c[1]} << 8 | std::uint32_t{c[2]});
}

/// A cloud as named float columns, in the order of the header's fields; the colour's bits are one of them.
using FloatColumns = std::vector<std::pair<std::string, std::vector<float>>>;

FloatColumns float_columns(const PointCloud& cloud) {
  FloatColumns columns;
  const auto add = [&](const std::string& name, auto value_of) {
    std::vector<float> values(cloud.size());
    for (std::size_t i = 0; i < values.size(); ++i) values[i] = value_of(i);
    columns.emplace_back(name, std::move(values));
  };
  const char* axes[] = {"x", "y", "z"};
  for (int a = 0; a < 3; ++a) add(axes[a], [&](std::size_t i) { return static_cast<float>(cloud.positions[i][a]); });
  for (int a = 0; a < 3 && !cloud.normals.empty(); ++a) {
    add(std::string("normal_") + axes[a], [&](std::size_t i) { return cloud.normals[i][a]; });
  }
  if (!cloud.colors.empty()) add("rgb", [&](std::size_t i) { return packed_rgb(cloud.colors[i]); });
  for (const auto& [name, values] : cloud.scalars) columns.emplace_back(name, values);
  return columns;
}

std::string header_text(const PointCloud& cloud, const FloatColumns& columns, PcdEncoding encoding) {
  const std::string points = std::to_string(cloud.size());
  std::string names, sizes, types, counts;
  for (const auto& [name, values] : columns) {
    names += " " + name;
    sizes += " 4";
    types += name == "rgb" && encoding == PcdEncoding::kAscii ? " U" : " F";
    counts += " 1";
  }
  return "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS" + names + "\nSIZE" + sizes + "\nTYPE" +
         types + "\nCOUNT" + counts + "\nWIDTH " + points + "\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS " + points;
}

std::string ascii_body(const FloatColumns& columns, std::size_t points) {
  std::string text;
  for (std::size_t i = 0; i < points; ++i) {
    for (const auto& [name, values] : columns) {
      if (name == "rgb") {
        base::append_number(text, std::bit_cast<std::uint32_t>(values[i]));
      } else {
        base::append_number(text, values[i]);
      }
      text += ' ';
    }
    text.back() = '\n';
  }
  return text;
}

std::string binary_body(const FloatColumns& columns, std::size_t points) {
  std::string bytes;
  bytes.reserve(points * columns.size() * sizeof(float));
  for (std::size_t i = 0; i < points; ++i) {
    for (const auto& column : columns) base::append_raw(bytes, column.second[i]);
  }
  return bytes;
}

std::string compressed_body(const FloatColumns& columns) {
  std::string expanded;
  for (const auto& column : columns) {
    for (const float value : column.second) base::append_raw(expanded, value);
  }
  const std::string compressed = base::lzf_compress(expanded);
  std::string bytes;
  base::append_raw(bytes, static_cast<std::uint32_t>(compressed.size()));
  base::append_raw(bytes, static_cast<std::uint32_t>(expanded.size()));
  return bytes + compressed;
}

}  // namespace

PointCloud parse_pcd(std::string_view bytes, const std::string& file) {
  const PcdHeader header = parse_pcd_header(bytes, file);
  const std::string_view body = bytes.substr(header.size_bytes);
  // Decompressed before memory is allocated for the points: only then is their number verified.
  const bool compressed = header.encoding == PcdEncoding::kBinaryCompressed;
  const std::string expanded = compressed ? expanded_body(body, header, file) : std::string();
  const Columns columns = columns_of(header);
  CloudColumns cloud(columns.columns, header.points, file);
  if (header.encoding == PcdEncoding::kAscii) {
    read_ascii(body, header, columns, file, cloud);
  } else {
    read_binary(compressed ? expanded : body, header, compressed, columns, cloud);
  }
  return header.height > 1 ? cloud.take_valid() : cloud.take();
}

std::string encode_pcd(const PointCloud& cloud, PcdEncoding encoding) {
  const FloatColumns columns = float_columns(cloud);
  const std::string header = header_text(cloud, columns, encoding);
  switch (encoding) {
    case PcdEncoding::kAscii:
      return header + "\nDATA ascii\n" + ascii_body(columns, cloud.size());
    case PcdEncoding::kBinary:
      return header + "\nDATA binary\n" + binary_body(columns, cloud.size());
    case PcdEncoding::kBinaryCompressed:
      return header + "\nDATA binary_compressed\n" + compressed_body(columns);
  }
  return header;
}

}  // namespace tileflight::geometry
