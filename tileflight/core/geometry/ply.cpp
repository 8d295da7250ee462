#include "tileflight/core/geometry/ply.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <fstream>
#include <optional>
#include <utility>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/core/geometry/cloud_columns.h"

namespace tileflight::geometry {

namespace {

ColorRange color_range_of(PlyType type) {
  if (type == PlyType::kFloat32 || type == PlyType::kFloat64) return ColorRange::kUnit;
  return type == PlyType::kUint16 ? ColorRange::kShort : ColorRange::kByte;
}

/// The columns of a cloud, and for each property of the element its column, -1 for lists.
struct VertexColumns {
  std::vector<CloudColumn> columns;
  std::vector<int> of_property;
};

VertexColumns columns_of(const PlyElement& vertex) {
  VertexColumns result;
  for (const PlyProperty& p : vertex.properties) {
    result.of_property.push_back(p.is_list ? -1 : static_cast<int>(result.columns.size()));
    if (!p.is_list) result.columns.push_back({p.name, color_range_of(p.type)});
  }
  return result;
}

/// Points whose values lie at fixed offsets. `first`: number of the first in the file.
PointCloud cloud_of_rows(const PlyRows& rows, const std::vector<CloudColumn>& columns, const std::string& file,
                         std::size_t first) {
  CloudColumns cloud(columns, rows.count(), file);
  tbb::parallel_for(std::uint64_t{0}, rows.count(), [&](std::uint64_t row) {
    for (std::size_t c = 0; c < columns.size(); ++c) cloud.set(c, row, rows.value(row, c));
  });
  return cloud.take(first);
}

template <typename Number>
void append_value(std::string& text, Number value, CloudEncoding encoding) {
  if (encoding == CloudEncoding::kBinary) {
    text.append(reinterpret_cast<const char*>(&value), sizeof(value));
    return;
  }
  base::append_number(text, value);
  text += ' ';
}

std::string ply_format_line(CloudEncoding encoding) {
  return encoding == CloudEncoding::kAscii ? "format ascii 1.0\n" : "format binary_little_endian 1.0\n";
}

/// `count` bytes from `offset` on, fewer at the end of the file.
std::string read_part(const std::filesystem::path& file, std::uint64_t offset, std::size_t count) {
  std::ifstream in(file, std::ios::binary);
  std::string bytes(count, '\0');
  in.seekg(static_cast<std::streamoff>(offset));
  in.read(bytes.data(), static_cast<std::streamsize>(count));
  if (!in && !in.eof()) throw InputError(file.string(), "cannot be read");
  bytes.resize(static_cast<std::size_t>(in.gcount()));
  return bytes;
}

/// Whether rows of fixed size follow the header.
bool begins_with_rows(const PlyHeader& header) {
  if (header.format == PlyFormat::kAscii || header.elements.empty() || header.elements.front().name != "vertex")
    return false;
  return std::ranges::none_of(header.elements.front().properties, &PlyProperty::is_list);
}

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

/// base::take_line for files of either line end.
std::optional<std::string_view> take_ply_line(std::string_view& text, char line_end) {
  if (line_end == '\n' || text.empty()) return base::take_line(text);
  const std::size_t end = std::min(text.find(line_end), text.size());
  const std::string_view line = text.substr(0, end);
  text.remove_prefix(std::min(end + 1, text.size()));
  return line;
}

/// Reads the numbers of the body in order, in either encoding.
class BodyReader {
 public:
  BodyReader(std::string_view body, const PlyHeader& header)
      : rest_(body), format_(header.format), line_end_(header.line_end) {}

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
      row_ = take_ply_line(rest_, line_end_).value_or("");
    } while (row_.find_first_not_of(" \t") == std::string_view::npos && !rest_.empty());
  }

  bool row_has_more() { return format_ == PlyFormat::kAscii && !base::take_field(row_).empty(); }

  /// Upper bound of the numbers left in this row.
  std::uint64_t bytes_left() const { return format_ == PlyFormat::kAscii ? row_.size() : rest_.size(); }

 private:
  std::string_view rest_;
  std::string_view row_;
  PlyFormat format_;
  char line_end_;
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

bool has_list(const PlyElement& element) {
  return std::any_of(element.properties.begin(), element.properties.end(),
                     [](const PlyProperty& p) { return p.is_list; });
}

}  // namespace

PointCloud parse_ply_cloud(std::string_view bytes, const std::string& file) {
  const PlyHeader header = parse_ply_header(bytes, file);
  const PlyElement* vertex = header.find("vertex");
  if (vertex == nullptr) throw InputError(file, "has no element 'vertex'");
  check_ply_sizes(bytes, header, file);
  const VertexColumns vertex_columns = columns_of(*vertex);
  if (const auto rows = PlyRows::find(bytes, header, "vertex", file))
    return cloud_of_rows(*rows, vertex_columns.columns, file, 0);
  CloudColumns cloud(vertex_columns.columns, vertex->count, file);
  visit_ply_element(bytes, header, "vertex", file,
                    [&](std::uint64_t row, std::size_t property, const std::vector<double>& values) {
                      const int column = vertex_columns.of_property[property];
                      if (column >= 0) cloud.set(static_cast<std::size_t>(column), row, values[0]);
                    });
  return cloud.take();
}

std::string cloud_rows(const PointCloud& cloud, CloudEncoding encoding, std::size_t first, std::size_t last) {
  std::string text;
  text.reserve((last - first) * 48);
  for (std::size_t i = first; i < last; ++i) {
    for (const double value : cloud.positions[i]) append_value(text, value, encoding);
    if (!cloud.normals.empty()) {
      for (const float value : cloud.normals[i]) append_value(text, value, encoding);
    }
    if (!cloud.colors.empty()) {
      for (const std::uint8_t value : cloud.colors[i]) append_value(text, value, encoding);
    }
    for (const auto& scalar : cloud.scalars) append_value(text, scalar.second[i], encoding);
    if (encoding == CloudEncoding::kAscii) text.back() = '\n';
  }
  return text;
}

std::string ply_cloud_header(const PointCloud& cloud, std::size_t points, CloudEncoding encoding) {
  std::string text = "ply\n" + ply_format_line(encoding) + "element vertex " + std::to_string(points) + "\n";
  for (const char* name : {"x", "y", "z"}) text += std::string("property double ") + name + "\n";
  if (!cloud.normals.empty()) text += "property float nx\nproperty float ny\nproperty float nz\n";
  if (!cloud.colors.empty()) text += "property uchar red\nproperty uchar green\nproperty uchar blue\n";
  for (const auto& scalar : cloud.scalars) text += "property float " + scalar.first + "\n";
  return text + "end_header\n";
}

std::optional<PlyCloudBlocks> PlyCloudBlocks::open(const std::filesystem::path& file) {
  constexpr std::size_t kLargestHeader = std::size_t{1} << 20;
  std::error_code error;
  if (base::to_lower(file.extension().string()) != ".ply" || !std::filesystem::is_regular_file(file, error))
    return std::nullopt;
  const std::string front = read_part(file, 0, kLargestHeader);
  if (!front.starts_with("ply") || front.find("\nend_header") == std::string::npos) return std::nullopt;
  PlyCloudBlocks blocks;
  blocks.file_ = file;
  blocks.header_ = parse_ply_header(front, file.string());
  if (!begins_with_rows(blocks.header_)) return std::nullopt;
  blocks.header_.elements.resize(1);
  blocks.row_bytes_ = ply_row_bytes(blocks.header_.elements.front());
  const std::uintmax_t bytes = std::filesystem::file_size(file, error);
  if (error || blocks.row_bytes_ == 0 || blocks.size() > (bytes - blocks.header_.size_bytes) / blocks.row_bytes_)
    return std::nullopt;
  CloudColumns(columns_of(blocks.header_.elements.front()).columns, 0, file.string());  // throws for unknown ones
  return blocks;
}

PointCloud PlyCloudBlocks::read(std::size_t first, std::size_t count) const {
  PlyHeader header = header_;
  header.elements.front().count = count;
  header.size_bytes = 0;
  const std::string rows = read_part(file_, header_.size_bytes + std::uint64_t{first} * row_bytes_, count * row_bytes_);
  if (rows.size() < count * row_bytes_) throw InputError(file_.string(), "has become shorter while it was read");
  return cloud_of_rows(*PlyRows::find(rows, header, "vertex", file_.string()),
                       columns_of(header.elements.front()).columns, file_.string(), first);
}

void write_ply_in_blocks(const std::filesystem::path& file, std::size_t points,
                         const std::function<PointCloud()>& next) {
  constexpr std::size_t kRowsAtOnce = 65536;
  PointCloud block;
  std::size_t in_block = 0, done = 0;
  bool begun = false;
  std::string part;
  base::write_file_in_parts(file, [&]() -> std::string_view {
    if (begun && done == points) return {};
    if (in_block == block.size()) {
      block = next();
      in_block = 0;
    }
    part = begun ? "" : ply_cloud_header(block, points, CloudEncoding::kBinary);
    begun = true;
    const std::size_t last = std::min(in_block + kRowsAtOnce, block.size());
    part += cloud_rows(block, CloudEncoding::kBinary, in_block, last);
    done += last - in_block;
    in_block = last;
    return part;
  });
}

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
  const std::size_t end = bytes.find_first_of("\r\n");
  if (end != std::string_view::npos && bytes[end] == '\r' && !bytes.substr(end).starts_with("\r\n")) {
    header.line_end = '\r';
  }
  if (base::trim(take_ply_line(rest, header.line_end).value_or("")) != "ply")
    throw InputError(file, "is not a PLY file: it does not start with 'ply'");
  bool format_known = false;
  for (int line_number = 2;; ++line_number) {
    const std::string where = file + ", line " + std::to_string(line_number);
    const auto line = take_ply_line(rest, header.line_end);
    if (!line) throw InputError(file, "the PLY header has no end_header: the file is truncated");
    const auto fields = base::split_fields(*line);
    if (fields.empty() || fields[0] == "obj_info") continue;
    if (fields[0] == "comment") {
      header.comments.emplace_back(base::trim(base::trim(*line).substr(fields[0].size())));
      continue;
    }
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
  BodyReader reader(body, header);
  for (const PlyElement& e : header.elements) {
    const bool wanted = e.name == element;
    read_element(reader, e, file, wanted ? &visit : nullptr);
    if (wanted) return;
  }
}

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
