#include "tileflight/geometry/cloud_files.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cctype>
#include <cmath>

#include "tileflight/base/files.h"
#include "tileflight/base/input_error.h"
#include "tileflight/base/text_fields.h"
#include "tileflight/geometry/cloud_columns.h"
#include "tileflight/geometry/pcd.h"
#include "tileflight/geometry/ply.h"

namespace tileflight::geometry {
namespace {

/// Limit of file size; clouds of several hundred million points are accepted.
constexpr std::uintmax_t kMaxBytes = std::uintmax_t{1} << 36;

InputError unknown_ending(const std::filesystem::path& file) {
  return {file.string(), "unknown point-cloud format (.ply, .pcd or .xyz expected)"};
}

ColorRange color_range_of(PlyType type) {
  if (type == PlyType::kFloat32 || type == PlyType::kFloat64) return ColorRange::kUnit;
  return type == PlyType::kUint16 ? ColorRange::kShort : ColorRange::kByte;
}

PointCloud parse_ply_cloud(std::string_view bytes, const std::string& file) {
  const PlyHeader header = parse_ply_header(bytes, file);
  const PlyElement* vertex = header.find("vertex");
  if (vertex == nullptr) throw InputError(file, "has no element 'vertex'");
  check_ply_sizes(bytes, header, file);
  std::vector<CloudColumn> columns;
  std::vector<int> column_of_property;
  for (const PlyProperty& p : vertex->properties) {
    column_of_property.push_back(p.is_list ? -1 : static_cast<int>(columns.size()));
    if (!p.is_list) columns.push_back({p.name, color_range_of(p.type)});
  }
  CloudColumns cloud(columns, vertex->count, file);
  if (const auto rows = PlyRows::find(bytes, header, "vertex", file)) {
    tbb::parallel_for(std::uint64_t{0}, rows->count(), [&](std::uint64_t row) {
      for (std::size_t c = 0; c < columns.size(); ++c) cloud.set(c, row, rows->value(row, c));
    });
    return cloud.take();
  }
  visit_ply_element(bytes, header, "vertex", file,
                    [&](std::uint64_t row, std::size_t property, const std::vector<double>& values) {
                      const int column = column_of_property[property];
                      if (column >= 0) cloud.set(static_cast<std::size_t>(column), row, values[0]);
                    });
  return cloud.take();
}

/// Names of the columns of XYZ text: those of a comment "# x y z …" on the first line, otherwise x y z column_4
/// column_5 ….
std::vector<CloudColumn> xyz_columns(std::string_view first_comment, std::size_t count) {
  std::vector<std::string_view> names = base::split_fields(first_comment);
  const bool named =
      names.size() == count && names.size() >= 3 && names[0] == "x" && names[1] == "y" && names[2] == "z";
  std::vector<CloudColumn> columns;
  for (std::size_t i = 0; i < count; ++i) {
    const std::string unnamed = i < 3 ? std::string(1, "xyz"[i]) : "column_" + std::to_string(i + 1);
    columns.push_back({named ? std::string(names[i]) : unnamed});
  }
  return columns;
}

std::vector<double> parse_xyz_line(std::string_view line, const std::string& where) {
  std::vector<double> values;
  for (const std::string_view field : base::split_fields(line, " \t,;")) {
    const auto value = base::parse_number<double>(field);
    if (!value) throw InputError(where, "'" + std::string(field.substr(0, 40)) + "' is not a number");
    values.push_back(*value);
  }
  return values;
}

PointCloud parse_xyz(std::string_view text, const std::string& file) {
  std::string_view first_comment;
  std::vector<std::vector<double>> rows;
  std::size_t line_number = 0;
  while (const auto line = base::take_line(text)) {
    ++line_number;
    std::string_view content = *line;
    content.remove_prefix(std::min(content.find_first_not_of(" \t"), content.size()));
    if (content.starts_with('#') && first_comment.empty()) first_comment = content.substr(1);
    if (content.empty() || content.starts_with('#')) continue;
    const std::string where = file + ", line " + std::to_string(line_number);
    rows.push_back(parse_xyz_line(content, where));
    if (rows.back().size() < 3) throw InputError(where, "expected at least x y z");
    if (rows.back().size() != rows[0].size())
      throw InputError(where, "its number of columns differs from the first line's");
  }
  if (rows.empty()) throw InputError(file, "contains no points");
  CloudColumns cloud(xyz_columns(first_comment, rows[0].size()), rows.size(), file);
  for (std::size_t i = 0; i < rows.size(); ++i) {
    for (std::size_t c = 0; c < rows[i].size(); ++c) cloud.set(c, i, rows[i][c]);
  }
  return cloud.take();
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

/// One row for each point in [first, last): position, normal, colour, scalars, as far as the cloud has them.
std::string point_rows(const PointCloud& cloud, CloudEncoding encoding, std::size_t first, std::size_t last) {
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

/// Writes header and rows, holding some thousand rows in memory at a time.
void write_rows(const std::filesystem::path& file, const std::string& header, const PointCloud& cloud,
                CloudEncoding encoding) {
  constexpr std::size_t kRowsAtOnce = 65536;
  std::string part = header;
  std::size_t done = 0;
  bool begun = false;
  base::write_file_in_parts(file, [&]() -> std::string_view {
    if (begun) {
      const std::size_t last = std::min(done + kRowsAtOnce, cloud.size());
      part = point_rows(cloud, encoding, done, last);
      done = last;
    }
    begun = true;
    return part;
  });
}

std::string ply_format_line(CloudEncoding encoding) {
  return encoding == CloudEncoding::kAscii ? "format ascii 1.0\n" : "format binary_little_endian 1.0\n";
}

std::string ply_header(const PointCloud& cloud, CloudEncoding encoding) {
  std::string text = "ply\n" + ply_format_line(encoding) + "element vertex " + std::to_string(cloud.size()) + "\n";
  for (const char* name : {"x", "y", "z"}) text += std::string("property double ") + name + "\n";
  if (!cloud.normals.empty()) text += "property float nx\nproperty float ny\nproperty float nz\n";
  if (!cloud.colors.empty()) text += "property uchar red\nproperty uchar green\nproperty uchar blue\n";
  for (const auto& scalar : cloud.scalars) text += "property float " + scalar.first + "\n";
  return text + "end_header\n";
}

std::string xyz_header(const PointCloud& cloud) {
  std::string text = "# x y z";
  if (!cloud.normals.empty()) text += " nx ny nz";
  if (!cloud.colors.empty()) text += " red green blue";
  for (const auto& scalar : cloud.scalars) text += " " + scalar.first;
  return text + "\n";
}

}  // namespace

PointCloud read_cloud(const std::filesystem::path& file) {
  const std::string ending = base::to_lower(file.extension().string());
  std::error_code error;
  if (!std::filesystem::exists(file, error))
    throw InputError(file.string(), "cannot be opened: No such file or directory");
  if (ending != ".ply" && ending != ".pcd" && ending != ".xyz") throw unknown_ending(file);
  const std::string bytes = base::read_text(file, kMaxBytes);
  if (ending == ".ply") return parse_ply_cloud(bytes, file.string());
  if (ending == ".pcd") return parse_pcd(bytes, file.string());
  return parse_xyz(bytes, file.string());
}

void write_cloud(const std::filesystem::path& file, const PointCloud& cloud, CloudEncoding encoding) {
  const std::string ending = base::to_lower(file.extension().string());
  if (ending == ".ply") return write_rows(file, ply_header(cloud, encoding), cloud, encoding);
  if (ending == ".xyz") return write_rows(file, xyz_header(cloud), cloud, CloudEncoding::kAscii);
  if (ending != ".pcd") throw unknown_ending(file);
  base::write_file(file,
                   encode_pcd(cloud, encoding == CloudEncoding::kAscii ? PcdEncoding::kAscii : PcdEncoding::kBinary));
}

}  // namespace tileflight::geometry
