#include "tileflight/core/geometry/voxel_grid.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <string_view>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/text_parsing.h"

namespace tileflight::geometry {
namespace {

/// Largest side, in cells, up to which a grid is padded to a cube, as binvox's specification requires ("should all be
/// equal"): readers disagree on the meaning of unequal numbers after `dim`. Above it, padding would be too expensive.
constexpr std::int64_t kLongestCube = 1024;

constexpr int kLongestRun = 255;

/// Sizes in the order of the data: first axis (slowest), up, second axis (fastest).
struct BinvoxDims {
  std::int64_t x = 0, z = 0, y = 0;

  std::int64_t cells() const { return x * z * y; }
  std::int64_t index(const Cell& c) const { return (c.x * z + c.z) * y + c.y; }
  Cell cell(std::int64_t index) const {
    return {static_cast<std::int32_t>(index / (z * y)), static_cast<std::int32_t>(index % y),
            static_cast<std::int32_t>(index / y % z)};
  }
};

BinvoxDims written_dims(const VoxelGrid& grid) {
  const std::int64_t longest = *std::max_element(grid.dims.begin(), grid.dims.end());
  if (longest <= kLongestCube) return {longest, longest, longest};
  return {grid.dims[0], grid.dims[2], grid.dims[1]};
}

/// Appends `length` cells of one value, in runs of at most 255.
void append_run(std::string& bytes, char value, std::int64_t length) {
  for (; length > 0; length -= kLongestRun) {
    bytes += value;
    bytes += static_cast<char>(std::min<std::int64_t>(length, kLongestRun));
  }
}

std::string runs_of(const VoxelGrid& grid, const BinvoxDims& dims) {
  std::vector<std::int64_t> indices;
  indices.reserve(grid.occupied.size());
  for (const Cell& c : grid.occupied) indices.push_back(dims.index(c));
  std::sort(indices.begin(), indices.end());
  std::string bytes;
  std::int64_t done = 0;
  for (std::size_t i = 0; i < indices.size();) {
    std::size_t end = i + 1;
    while (end < indices.size() && indices[end] == indices[end - 1] + 1) ++end;
    append_run(bytes, 0, indices[i] - done);
    append_run(bytes, 1, static_cast<std::int64_t>(end - i));
    done = indices[end - 1] + 1;
    i = end;
  }
  append_run(bytes, 0, dims.cells() - done);
  return bytes;
}

struct BinvoxHeader {
  BinvoxDims dims;
  Vec3 translate = Vec3::Zero();
  double scale = 1.0;
  std::size_t size_bytes = 0;
};

/// `count` numbers after a key.
template <typename Number>
std::vector<Number> numbers_after_key(const std::vector<std::string_view>& fields, std::size_t count,
                                      const std::string& where) {
  std::vector<Number> numbers;
  for (std::size_t i = 1; i < fields.size(); ++i) {
    if (const auto number = base::parse_number<Number>(fields[i])) numbers.push_back(*number);
  }
  if (numbers.size() != count || fields.size() != count + 1) {
    throw InputError(where, "expected " + std::to_string(count) + " numbers after '" + std::string(fields[0]) + "'");
  }
  return numbers;
}

BinvoxDims parse_dims(const std::vector<std::string_view>& fields, const std::string& where) {
  const auto numbers = numbers_after_key<std::int32_t>(fields, 3, where);
  if (*std::min_element(numbers.begin(), numbers.end()) < 1) throw InputError(where, "a side has no cells");
  const BinvoxDims dims{numbers[0], numbers[1], numbers[2]};
  if (static_cast<double>(dims.x) * static_cast<double>(dims.y) * static_cast<double>(dims.z) > 9e18) {
    throw InputError(where, "too many cells");
  }
  return dims;
}

/// Applies one line between the first and "data".
void apply_binvox_line(BinvoxHeader& header, const std::vector<std::string_view>& fields, const std::string& where) {
  if (fields[0] == "dim") {
    header.dims = parse_dims(fields, where);
  } else if (fields[0] == "translate") {
    const auto numbers = numbers_after_key<double>(fields, 3, where);
    header.translate = Vec3(numbers[0], numbers[1], numbers[2]);
  } else if (fields[0] == "scale") {
    header.scale = numbers_after_key<double>(fields, 1, where)[0];
  } else {
    throw InputError(where, "'" + std::string(fields[0].substr(0, 40)) + "' is not a key of a binvox header");
  }
}

BinvoxHeader parse_binvox_header(std::string_view bytes, const std::string& file) {
  BinvoxHeader header;
  std::string_view rest = bytes;
  const auto first = base::split_fields(base::take_line(rest).value_or(""));
  if (first.size() != 2 || first[0] != "#binvox" || first[1] != "1") {
    throw InputError(file, "is not a binvox file of version 1: it does not start with '#binvox 1'");
  }
  for (int line_number = 2;; ++line_number) {
    const auto line = base::take_line(rest);
    if (!line) throw InputError(file, "the binvox header has no line 'data': the file is truncated");
    const auto fields = base::split_fields(*line);
    if (fields.empty()) continue;
    if (fields[0] == "data") break;
    apply_binvox_line(header, fields, file + ", line " + std::to_string(line_number));
  }
  if (header.dims.cells() == 0) throw InputError(file, "the binvox header has no line 'dim'");
  if (!header.translate.allFinite() || !std::isfinite(header.scale) || header.scale <= 0.0) {
    throw InputError(file, "translate and scale must be finite, scale above zero");
  }
  header.size_bytes = bytes.size() - rest.size();
  return header;
}

VoxelGrid frame_of(const BinvoxHeader& header) {
  const BinvoxDims& dims = header.dims;
  VoxelGrid grid;
  grid.origin = header.translate;
  grid.edge_m = header.scale / static_cast<double>(std::max({dims.x, dims.y, dims.z}));
  grid.dims = {static_cast<std::int32_t>(dims.x), static_cast<std::int32_t>(dims.y), static_cast<std::int32_t>(dims.z)};
  return grid;
}

std::vector<Cell> parse_runs(std::string_view bytes, const BinvoxHeader& header, const std::string& file) {
  std::vector<Cell> occupied;
  std::int64_t index = 0;
  for (std::size_t at = header.size_bytes; at + 1 < bytes.size() && index < header.dims.cells(); at += 2) {
    const auto value = static_cast<unsigned char>(bytes[at]);
    const auto length = static_cast<unsigned char>(bytes[at + 1]);
    if (value > 1) throw InputError(file + ", byte " + std::to_string(at), "the value of a run must be 0 or 1");
    if (index + length > header.dims.cells()) {
      throw InputError(file + ", byte " + std::to_string(at), "the runs hold more cells than 'dim' declares");
    }
    for (int i = 0; value == 1 && i < length; ++i) occupied.push_back(header.dims.cell(index + i));
    index += length;
  }
  if (index != header.dims.cells()) {
    throw InputError(file, "the runs hold " + std::to_string(index) + " of " + std::to_string(header.dims.cells()) +
                               " cells: the file is truncated");
  }
  std::sort(occupied.begin(), occupied.end());
  return occupied;
}

}  // namespace

Vec3 center_by_equation(const VoxelGrid& grid, const Cell& cell) {
  // Equation (1): ((i + 0.5) / d, (j + 0.5) / d, (k + 0.5) / d), where d is the number of cells along the longest side.
  const double d = *std::max_element(grid.dims.begin(), grid.dims.end());
  const Vec3 normalised = (Vec3(cell.x, cell.y, cell.z) + Vec3::Constant(0.5)) / d;
  return normalised * (d * grid.edge_m) + grid.origin;
}

PointCloud cell_centers(const VoxelGrid& grid) {
  PointCloud cloud;
  cloud.positions.reserve(grid.occupied.size());
  for (const Cell& c : grid.occupied) cloud.positions.push_back(center_by_equation(grid, c));
  return cloud;
}

void write_binvox(const std::filesystem::path& file, const VoxelGrid& grid) {
  const BinvoxDims dims = written_dims(grid);
  std::string text = "#binvox 1\ndim";
  for (const std::int64_t side : {dims.x, dims.z, dims.y}) text += " " + std::to_string(side);
  text += "\ntranslate";
  for (const double value : grid.origin) {
    text += ' ';
    base::append_number(text, value);
  }
  text += "\nscale ";
  base::append_number(text, grid.edge_m * static_cast<double>(std::max({dims.x, dims.y, dims.z})));
  base::write_file(file, text + "\ndata\n" + runs_of(grid, dims));
}

VoxelGrid read_binvox(const std::filesystem::path& file) {
  const std::string bytes = base::read_raw(file);
  const BinvoxHeader header = parse_binvox_header(bytes, file.string());
  VoxelGrid grid = frame_of(header);
  grid.occupied = parse_runs(bytes, header, file.string());
  return grid;
}

VoxelGrid read_binvox_header(const std::filesystem::path& file) {
  return frame_of(parse_binvox_header(base::read_raw(file), file.string()));
}

}  // namespace tileflight::geometry
