#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "tileflight/core/geometry/cloud_columns.h"
#include "tileflight/core/geometry/cloud_files.h"
#include "tileflight/core/geometry/ply.h"

// Clouds as the element `vertex` of PLY files, whole and in blocks.

namespace tileflight::geometry {

/// The points of a PLY file's content. Throws InputError as read_cloud() does.
PointCloud parse_ply_cloud(std::string_view bytes, const std::string& file);

/// Header of a PLY file of `points` points with the attributes of `cloud`.
std::string ply_cloud_header(const PointCloud& cloud, std::size_t points, CloudEncoding encoding);

/// One row for each point in [first, last): position, normal, colour, scalars, as far as the cloud has them; the rows
/// of PLY and of XYZ text.
std::string cloud_rows(const PointCloud& cloud, CloudEncoding encoding, std::size_t first, std::size_t last);

/// A PLY file of which some points at a time are read.
class PlyCloudBlocks {
 public:
  /// nullopt if the points' places in the file are not known beforehand (another format, text, a list among their
  /// properties, something before them, truncated): read_cloud() reads such a file, or says what is wrong. Throws
  /// InputError for properties that are no cloud's.
  static std::optional<PlyCloudBlocks> open(const std::filesystem::path& file);

  std::size_t size() const { return static_cast<std::size_t>(header_.elements.front().count); }

  /// Points [first, first + count) as read_cloud() gives them. Throws InputError, also for a file that has become
  /// shorter.
  PointCloud read(std::size_t first, std::size_t count) const;

 private:
  std::filesystem::path file_;
  PlyHeader header_;
  std::size_t row_bytes_ = 0;
};

/// Writes a binary PLY file as write_cloud() does, of `points` points. `next` returns consecutive blocks of them, all
/// with the same attributes. Throws InputError.
void write_ply_in_blocks(const std::filesystem::path& file, std::size_t points,
                         const std::function<PointCloud()>& next);

}  // namespace tileflight::geometry
