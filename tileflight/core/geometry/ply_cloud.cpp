#include "tileflight/core/geometry/ply_cloud.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <fstream>
#include <utility>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/text_parsing.h"

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

}  // namespace tileflight::geometry
