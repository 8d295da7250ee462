#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/geometry/transform.h"
#include "tileflight/core/imaging/textured_mesh.h"
#include "tileflight/tiles/tile_content/json_reader.h"

namespace tileflight::tile_content {

// Common header of 3D Tiles 1.0 containers (b3dm, i3dm, pnts, cmpt) and GLB: magic, version, total length.

/// Returns the content truncated to its own byteLength. Throws InputError if it is shorter than that.
std::span<const std::byte> trim_to_byte_length(std::span<const std::byte> bytes, std::size_t header_bytes,
                                               const std::string& name);

/// Throws InputError if the version differs from `expected`.
void require_version(std::span<const std::byte> bytes, std::uint32_t expected, const std::string& kind,
                     const std::string& name);

/// Sections of a tile between header and body, and the body.
struct TileTables {
  std::span<const std::byte> feature_json, feature_binary, batch_json, batch_binary;
  std::span<const std::byte> body;
};

/// Lengths of the sections of a tile, and of the header before them.
struct TileTableLengths {
  std::size_t header = 28;
  std::size_t feature_json = 0, feature_binary = 0, batch_json = 0, batch_binary = 0;
};

/// Reads the lengths of the sections from the header, starting at byte 12.
TileTableLengths read_table_lengths(std::span<const std::byte> tile, std::size_t header_bytes);

/// Splits a tile into its sections. Throws InputError if they extend beyond the end.
TileTables split_tables(std::span<const std::byte> tile, const TileTableLengths& lengths, const std::string& name);

/// Decodes a unit vector from its octahedral encoding, two numbers in 0..`range` (Cigolle et al., "A Survey of
/// Efficient Representations for Independent Unit Vectors", 2014).
inline Eigen::Vector3d decode_octahedral(double u, double v, double range) {
  const double x = 2 * u / range - 1;
  const double y = 2 * v / range - 1;
  Eigen::Vector3d out(x, y, 1 - std::abs(x) - std::abs(y));
  if (out.z() < 0) {
    out.x() = (1 - std::abs(y)) * (x < 0 ? -1 : 1);
    out.y() = (1 - std::abs(x)) * (y < 0 ? -1 : 1);
  }
  return out.normalized();
}

/// A feature table or batch table of 3D Tiles 1.0: JSON whose members contain values or refer to the binary part
/// ("Feature Table", "Batch Table"). Every access is checked before allocation.
class TileTable {
 public:
  /// `binary` must outlive this object. Throws InputError (where, cause) if the JSON is malformed.
  TileTable(std::span<const std::byte> json, std::span<const std::byte> binary, const std::string& where);

  const Json& json() const { return json_; }
  const std::string& where() const { return where_; }

  /// Returns a global integer; nullopt if there is none.
  std::optional<std::size_t> count(const char* key) const;
  /// Returns `components` global numbers, from the JSON or as floats from the binary part; nullopt if there are none.
  std::optional<std::vector<double>> global(const char* key, std::size_t components) const;
  /// Returns `count` numbers of type T, interleaved (x y z x y z …), from the binary part or the JSON; nullopt if there
  /// are none.
  template <class T>
  std::optional<std::vector<T>> values(const char* key, std::size_t count) const {
    const Json* member = find_member(json_, key);
    if (member == nullptr) return std::nullopt;
    if (member->is_array()) {
      const std::vector<double> numbers = *find_numbers(json_, key, count, where_);
      std::vector<T> out(numbers.size());
      for (std::size_t i = 0; i < out.size(); ++i) out[i] = static_cast<T>(numbers[i]);
      return out;
    }
    const std::span<const std::byte> bytes = binary_part(*member, key, count, sizeof(T));
    std::vector<T> out(count);
    if (count > 0) std::memcpy(out.data(), bytes.data(), bytes.size());
    return out;
  }
  /// Returns unit vectors, stored plain (three floats each) or octahedral (two numbers of type T); empty if neither is
  /// given.
  template <class T>
  std::vector<geometry::Vec3> directions(const char* plain, const char* octahedral, std::size_t count) const {
    std::vector<geometry::Vec3> out;
    if (const auto floats = values<float>(plain, 3 * count)) {
      for (std::size_t i = 0; i < count; ++i)
        out.emplace_back((*floats)[3 * i], (*floats)[3 * i + 1], (*floats)[3 * i + 2]);
    } else if (const auto pairs = values<T>(octahedral, 2 * count)) {
      for (std::size_t i = 0; i < count; ++i)
        out.push_back(decode_octahedral((*pairs)[2 * i], (*pairs)[2 * i + 1], std::numeric_limits<T>::max()));
    }
    return out;
  }
  /// Returns RTC_CENTER, to which positions are relative; 0 if there is none.
  geometry::Vec3 rtc_center() const;
  /// POSITION_QUANTIZED: positions are offset + number * scale / 65535.
  struct QuantizedPositions {
    std::vector<std::uint16_t> numbers;
    std::vector<double> scale, offset;
  };
  /// Reads POSITION_QUANTIZED. Throws InputError if a part is missing.
  QuantizedPositions quantized_positions(std::size_t count) const;
  /// Reads ids, one per entry: bytes, shorts or ints, by `componentType` (default: short).
  std::optional<std::vector<std::uint32_t>> ids(const char* key, std::size_t count) const;

 private:
  std::span<const std::byte> binary_part(const Json& reference, const char* key, std::size_t count,
                                         std::size_t bytes_each) const;

  Json json_;
  std::span<const std::byte> binary_;
  std::string where_;
};

/// Reads a batch table of `count` features as text; nullptr if it has no properties. Throws InputError.
std::shared_ptr<const imaging::FeatureTable> read_batch_table(std::span<const std::byte> json,
                                                              std::span<const std::byte> binary, std::size_t count,
                                                              const std::string& where);

/// Reads a batch table like read_batch_table(), but a broken table only adds a warning: features without names are
/// better than no tile.
std::shared_ptr<const imaging::FeatureTable> try_read_batch_table(const TileTables& tables, std::size_t count,
                                                                  std::vector<std::string>& warnings);

/// Appends a warning unless it is already there.
void warn_once(const std::string& what, std::vector<std::string>& warnings);

}  // namespace tileflight::tile_content
