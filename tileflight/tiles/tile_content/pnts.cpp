#include "tileflight/tiles/tile_content/pnts.h"

#include <draco/compression/decode.h>

#include <array>
#include <cmath>
#include <memory>
#include <optional>

#include "tileflight/core/base/input_error.h"
#include "tileflight/tiles/tile_content/tile_table.h"

namespace tileflight::tile_content {
namespace {

using Bytes = std::span<const std::byte>;
using geometry::PointCloud;
using geometry::Vec3;
using Color = std::array<std::uint8_t, 3>;

/// The Draco-compressed part of a point cloud: the properties that the feature table refers to by id.
class DracoPoints {
 public:
  DracoPoints(const Json& extension, Bytes binary, const std::string& where) : where_(where) {
    const std::size_t offset = require_value(find_index(extension, "byteOffset", where), "byteOffset", where);
    const std::size_t length = require_value(find_index(extension, "byteLength", where), "byteLength", where);
    if (offset > binary.size() || length > binary.size() - offset) {
      throw InputError(where, "lies outside the table's binary part");
    }
    draco::DecoderBuffer buffer;
    buffer.Init(reinterpret_cast<const char*>(binary.data()) + offset, length);
    draco::Decoder decoder;
    auto result = decoder.DecodePointCloudFromBuffer(&buffer);
    if (!result.ok()) throw InputError(where, "cannot be decoded: " + result.status().error_msg_string());
    cloud_ = std::move(result).value();
    const Json* properties = find_object(extension, "properties", where);
    if (properties != nullptr) properties_ = *properties;
  }

  std::size_t size() const { return cloud_->num_points(); }

  /// `components` numbers per point; nullopt if the property is not in the compressed part.
  std::optional<std::vector<float>> values(const char* property, std::size_t components) const {
    const auto id = find_index(properties_, property, where_, 0xFFFFFFFF);
    if (!id) return std::nullopt;
    const draco::PointAttribute* attribute = cloud_->GetAttributeByUniqueId(static_cast<std::uint32_t>(*id));
    if (attribute == nullptr || static_cast<std::size_t>(attribute->num_components()) != components) {
      throw InputError(where_, std::string("has no ") + property + " of " + std::to_string(components) + " components");
    }
    std::vector<float> out(size() * components);
    for (draco::PointIndex point(0); point < cloud_->num_points(); ++point) {
      const draco::AttributeValueIndex index = attribute->mapped_index(point);
      if (index.value() >= attribute->size()) throw InputError(where_, std::string(property) + " is truncated");
      attribute->ConvertValue<float>(index, static_cast<std::int8_t>(components), &out[point.value() * components]);
    }
    return out;
  }

 private:
  std::string where_;
  std::unique_ptr<draco::PointCloud> cloud_;
  Json properties_;
};

/// Reads one tile's feature table; one object per tile.
class PointReader {
 public:
  PointReader(const TileTable& table, Bytes binary) : table_(table) {
    const Json* extensions = find_object(table.json(), "extensions", table.where());
    const Json* draco =
        extensions == nullptr ? nullptr : find_object(*extensions, "3DTILES_draco_point_compression", table.where());
    if (draco != nullptr) draco_.emplace(*draco, binary, table.where() + ": 3DTILES_draco_point_compression");
  }

  /// `table_bytes`: size of the table; an uncompressed point takes at least one byte.
  PointCloud read(std::size_t max_points, std::size_t table_bytes) {
    count_ = require_value(table_.count("POINTS_LENGTH"), "POINTS_LENGTH", table_.where());
    if (draco_ && draco_->size() != count_) {
      throw InputError(table_.where(), "POINTS_LENGTH is " + std::to_string(count_) + ", but the Draco part has " +
                                           std::to_string(draco_->size()));
    }
    if (count_ > max_points) {
      throw InputError(table_.where(), "has more than " + std::to_string(max_points) + " points, which is the limit");
    }
    if (!draco_ && count_ > table_bytes)
      throw InputError(table_.where(), "the number of points differs from POINTS_LENGTH");
    PointCloud cloud;
    if (count_ == 0) return cloud;
    cloud.positions = positions();
    cloud.colors = colors();
    cloud.normals = normals();
    if (const auto packed = from_draco("BATCH_ID", 1)) {
      cloud.scalars[kFeatureIdScalar] = *packed;
    } else if (const auto ids = table_.ids("BATCH_ID", count_)) {
      cloud.scalars[kFeatureIdScalar] = std::vector<float>(ids->begin(), ids->end());
    }
    return cloud;
  }

 private:
  std::optional<std::vector<float>> from_draco(const char* property, std::size_t components) const {
    return draco_ ? draco_->values(property, components) : std::nullopt;
  }

  std::vector<Vec3> positions() const {
    const Vec3 rtc_center = table_.rtc_center();
    auto floats = from_draco("POSITION", 3);
    if (!floats) floats = table_.values<float>("POSITION", 3 * count_);
    std::vector<Vec3> out(count_);
    if (floats) {
      for (std::size_t i = 0; i < count_; ++i) {
        out[i] = rtc_center + Vec3((*floats)[3 * i], (*floats)[3 * i + 1], (*floats)[3 * i + 2]);
      }
    } else {
      const auto [numbers, scale, offset] = table_.quantized_positions(count_);
      for (std::size_t i = 0; i < 3 * count_; ++i) {
        const auto c = static_cast<Eigen::Index>(i % 3);
        out[i / 3][c] = rtc_center[c] + offset[i % 3] + numbers[i] * scale[i % 3] / 65535.0;
      }
    }
    for (const Vec3& point : out) {
      if (!point.allFinite()) throw InputError(table_.where(), "a position is not finite");
    }
    return out;
  }

  /// The first existing one of RGBA, RGB, RGB565 and CONSTANT_RGBA, the order of the specification.
  std::vector<Color> colors() const {
    for (const auto& [key, components] : {std::pair("RGBA", std::size_t{4}), std::pair("RGB", std::size_t{3})}) {
      if (const auto packed = from_draco(key, components)) return colors_of(*packed, components);
      if (const auto bytes = table_.values<std::uint8_t>(key, components * count_))
        return colors_of(*bytes, components);
    }
    if (const auto words = table_.values<std::uint16_t>("RGB565", count_)) return colors_of_565(*words);
    if (const auto constant = table_.values<std::uint8_t>("CONSTANT_RGBA", 4)) {
      return std::vector<Color>(count_, Color{(*constant)[0], (*constant)[1], (*constant)[2]});
    }
    return {};
  }

  template <class T>
  static std::vector<Color> colors_of(const std::vector<T>& values, std::size_t components) {
    std::vector<Color> out(values.size() / components);
    for (std::size_t i = 0; i < out.size(); ++i) {
      for (std::size_t c = 0; c < 3; ++c) out[i][c] = static_cast<std::uint8_t>(values[components * i + c]);
    }
    return out;
  }

  static std::vector<Color> colors_of_565(const std::vector<std::uint16_t>& words) {
    std::vector<Color> out(words.size());
    const auto scaled = [](unsigned value, unsigned max) {
      return static_cast<std::uint8_t>(std::lround(255.0 * value / max));
    };
    for (std::size_t i = 0; i < out.size(); ++i) {
      const unsigned word = words[i];
      out[i] = {scaled(word >> 11U, 31), scaled(word >> 5U & 63U, 63), scaled(word & 31U, 31)};
    }
    return out;
  }

  std::vector<Eigen::Vector3f> normals() const {
    std::vector<Eigen::Vector3f> out;
    if (const auto floats = from_draco("NORMAL", 3)) {
      for (std::size_t i = 0; i < count_; ++i)
        out.emplace_back((*floats)[3 * i], (*floats)[3 * i + 1], (*floats)[3 * i + 2]);
      return out;
    }
    for (const Vec3& normal : table_.directions<std::uint8_t>("NORMAL", "NORMAL_OCT16P", count_))
      out.push_back(normal.cast<float>());
    return out;
  }

  const TileTable& table_;
  std::optional<DracoPoints> draco_;
  std::size_t count_ = 0;
};

}  // namespace

void append_pnts(Bytes bytes, const std::string& name, const ContentOptions& options, DecodedContent& out) {
  constexpr std::size_t kHeader = 28;
  const Bytes tile = trim_to_byte_length(bytes, kHeader, name);
  require_version(tile, 1, "pnts", name);
  const TileTables tables = split_tables(tile, read_table_lengths(tile, kHeader), name);
  const TileTable table(tables.feature_json, tables.feature_binary, name + ": feature table");
  const std::size_t table_bytes = tables.feature_json.size() + tables.feature_binary.size();
  PointCloud cloud = PointReader(table, tables.feature_binary).read(options.limits.max_points, table_bytes);
  if (!cloud.positions.empty()) out.clouds.push_back(std::move(cloud));
}

}  // namespace tileflight::tile_content
