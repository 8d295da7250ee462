#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "tileflight/core/geometry/point_cloud.h"

namespace tileflight::geometry {

/// Range of the file's colour values that is mapped to 0..255.
enum class ColorRange { kByte, kShort, kUnit };

/// A named column of a point file, as declared in its header.
struct CloudColumn {
  std::string name;
  ColorRange color_range = ColorRange::kByte;  ///< by the file's number type: bytes, 16-bit numbers, or floats 0 to 1
};

/// Assigns the columns of a point file to the arrays of a cloud by the names used in PLY and PCD files: x y z (or X Y
/// Z), nx ny nz or normal_x normal_y normal_z, red green blue (also r g b, diffuse_red …), rgb and rgba (packed
/// 0xAARRGGBB); all others become scalars.
class CloudColumns {
 public:
  /// Throws InputError if x, y or z is missing or a name occurs twice. `where` prefixes error messages.
  CloudColumns(std::vector<CloudColumn> columns, std::size_t points, std::string where);

  void set(std::size_t column, std::size_t point, double value) {
    const Target& target = targets_[column];
    switch (target.kind) {
      case Kind::kPosition:
        cloud_.positions[point][target.axis] = value;
        break;
      case Kind::kNormal:
        cloud_.normals[point][target.axis] = static_cast<float>(value);
        break;
      case Kind::kColor:
        set_color(target, point, value);
        break;
      case Kind::kPackedColor:
        set_packed_color(point, static_cast<std::uint32_t>(value));
        break;
      case Kind::kScalar:
        (*target.scalar)[point] = static_cast<float>(value);
        break;
      case Kind::kIgnored:
        break;
    }
  }

  /// The cloud; throws InputError if a position or normal is not finite. `first`: number of its first point in
  /// messages.
  PointCloud take(std::size_t first = 0);

  /// The cloud without the points whose position is not finite.
  PointCloud take_valid();

 private:
  enum class Kind { kPosition, kNormal, kColor, kPackedColor, kScalar, kIgnored };
  struct Target {
    Kind kind = Kind::kIgnored;
    int axis = 0;
    double color_scale = 1.0;
    std::vector<float>* scalar = nullptr;
  };

  static Target target_of(const CloudColumn& column);
  void allocate(std::size_t points, const std::vector<CloudColumn>& columns);
  void set_color(const Target& target, std::size_t point, double value);
  void set_packed_color(std::size_t point, std::uint32_t argb);

  std::string where_;
  std::vector<Target> targets_;
  PointCloud cloud_;
};

}  // namespace tileflight::geometry
