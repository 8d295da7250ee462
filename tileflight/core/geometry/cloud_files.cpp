#include "tileflight/core/geometry/cloud_files.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <fstream>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/core/geometry/cloud_columns.h"
#include "tileflight/core/geometry/ply.h"

namespace tileflight::geometry {
namespace {

/// Limit of file size; clouds of several hundred million points are accepted.
constexpr std::uintmax_t kMaxBytes = std::uintmax_t{1} << 36;

InputError unknown_ending(const std::filesystem::path& file) {
  return {file.string(), "unknown point-cloud format (.ply, .pcd or .xyz expected)"};
}

/// The refusal of a file in a known format that is not read, with the way to convert it; else unknown_ending().
InputError unread_format(const std::filesystem::path& file, const std::string& ending) {
  std::string head(8, '\0');
  std::ifstream(file, std::ios::binary).read(head.data(), static_cast<std::streamsize>(head.size()));
  const bool is_las = head.starts_with("LASF") || ending == ".las" || ending == ".laz";
  if (!is_las && !head.starts_with("ASTM-E57") && ending != ".e57") return unknown_ending(file);
  return {file.string(), std::string(is_las ? "a LAS or LAZ cloud" : "an E57 scan") +
                             ", which is not read: convert it first, for example with `pdal translate " +
                             file.filename().string() + " cloud.ply` or in CloudCompare (.ply, .pcd or .xyz expected)"};
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
      part = cloud_rows(cloud, encoding, done, last);
      done = last;
    }
    begun = true;
    return part;
  });
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
  if (ending != ".ply" && ending != ".pcd" && ending != ".xyz") throw unread_format(file, ending);
  const std::string whole = base::read_raw(file, kMaxBytes);
  const std::string_view bytes = base::strip_byte_order_mark(whole);
  if (ending == ".ply") return parse_ply_cloud(bytes, file.string());
  if (ending == ".pcd") return parse_pcd(bytes, file.string());
  return parse_xyz(bytes, file.string());
}

void write_cloud(const std::filesystem::path& file, const PointCloud& cloud, CloudEncoding encoding) {
  const std::string ending = base::to_lower(file.extension().string());
  if (ending == ".ply") return write_rows(file, ply_cloud_header(cloud, cloud.size(), encoding), cloud, encoding);
  if (ending == ".xyz") return write_rows(file, xyz_header(cloud), cloud, CloudEncoding::kAscii);
  if (ending != ".pcd") throw unknown_ending(file);
  base::write_file(file,
                   encode_pcd(cloud, encoding == CloudEncoding::kAscii ? PcdEncoding::kAscii : PcdEncoding::kBinary));
}

}  // namespace tileflight::geometry
