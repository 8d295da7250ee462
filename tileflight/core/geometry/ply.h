#pragma once

// PLY files: their header and elements, and clouds as the element `vertex`, whole and in blocks.

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "tileflight/core/geometry/cloud_files.h"

namespace tileflight::geometry {

/// Number types of the PLY format (Turk 1994); each has two spellings in files.
enum class PlyType { kInt8, kUint8, kInt16, kUint16, kInt32, kUint32, kFloat32, kFloat64 };

struct PlyProperty {
  std::string name;
  PlyType type = PlyType::kFloat32;
  bool is_list = false;
  PlyType count_type = PlyType::kUint8;  ///< type of a list's length
};

struct PlyElement {
  std::string name;
  std::uint64_t count = 0;
  std::vector<PlyProperty> properties;
};

enum class PlyFormat { kAscii, kLittleEndian, kBigEndian };

struct PlyHeader {
  PlyFormat format = PlyFormat::kAscii;
  std::vector<PlyElement> elements;
  std::vector<std::string> comments;  ///< the texts of the comment lines
  char line_end = '\n';               ///< '\r' in files whose lines end with it alone
  std::size_t size_bytes = 0;         ///< up to and including the line "end_header"

  /// nullptr if there is no such element.
  const PlyElement* find(std::string_view element) const;
};

/// Returns the bytes of a row of a binary element; a list counts by its length alone.
std::size_t ply_row_bytes(const PlyElement& element);

/// Parses the header at the front of `bytes`; `file` is used in messages. Throws InputError (file, line, cause).
PlyHeader parse_ply_header(std::string_view bytes, const std::string& file);

/// Checks that the counts in the header fit into a file of this size, before memory is allocated. Throws InputError.
void check_ply_sizes(std::string_view bytes, const PlyHeader& header, const std::string& file);

/// Receives each value of the visited element: row, property, its numbers (one, or those of a list).
using PlyVisitor = std::function<void(std::uint64_t row, std::size_t property, const std::vector<double>& values)>;

/// Reads all values of `element` in order; elements before it are skipped. Throws InputError (file, element, row,
/// cause).
void visit_ply_element(std::string_view bytes, const PlyHeader& header, std::string_view element,
                       const std::string& file, const PlyVisitor& visit);

/// Random access to the rows of a binary element whose values lie at fixed offsets; safe from any thread.
class PlyRows {
 public:
  /// nullopt if the values have no fixed offsets: text format, or a list in the element or before it. Checks that the
  /// rows lie inside the file; throws InputError (file, cause).
  static std::optional<PlyRows> find(std::string_view bytes, const PlyHeader& header, std::string_view element,
                                     const std::string& file);

  std::uint64_t count() const { return count_; }
  double value(std::uint64_t row, std::size_t property) const;

 private:
  struct PropertyOffset {
    std::size_t offset = 0;
    PlyType type = PlyType::kFloat32;
  };

  const char* first_ = nullptr;
  std::uint64_t count_ = 0;
  std::size_t row_bytes_ = 0;
  bool swap_ = false;                       ///< file is big endian
  std::vector<PropertyOffset> properties_;  ///< one for each property
};

/// Parses the points of a PLY file. Throws InputError as read_cloud() does.
PointCloud parse_ply_cloud(std::string_view bytes, const std::string& file);

/// Returns the header of a PLY file of `points` points with the attributes of `cloud`.
std::string ply_cloud_header(const PointCloud& cloud, std::size_t points, CloudEncoding encoding);

/// Encodes one row for each point in [first, last): position, normal, colour, scalars, as far as the cloud has them;
/// the rows of PLY and of XYZ text.
std::string cloud_rows(const PointCloud& cloud, CloudEncoding encoding, std::size_t first, std::size_t last);

/// A PLY file that is read some points at a time.
class PlyCloudBlocks {
 public:
  /// Opens a file. nullopt if the points' offsets are not known beforehand (another format, text, a list among their
  /// properties, an element before them, a truncated file): read_cloud() reads such a file, or reports what is wrong.
  /// Throws InputError for properties that no cloud has.
  static std::optional<PlyCloudBlocks> open(const std::filesystem::path& file);

  std::size_t size() const { return static_cast<std::size_t>(header_.elements.front().count); }

  /// Reads points [first, first + count) as read_cloud() does. Throws InputError, also for a file that was truncated
  /// meanwhile.
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
