#include "tileflight/core/geometry/cloud_columns.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/text_parsing.h"

namespace tileflight::geometry {
namespace {

/// Index of `name` among `names`, or -1.
int position_in(const std::vector<std::string>& names, const std::string& name) {
  const auto found = std::find(names.begin(), names.end(), name);
  return found == names.end() ? -1 : static_cast<int>(found - names.begin());
}

double scale_of(ColorRange range) {
  switch (range) {
    case ColorRange::kByte:
      return 1.0;
    case ColorRange::kShort:
      return 255.0 / 65535.0;
    case ColorRange::kUnit:
      return 255.0;
  }
  return 1.0;
}

/// PDAL names the axes X, Y and Z in PCD files.
void name_axes_in_lower_case(std::vector<CloudColumn>& columns) {
  const auto has = [&](const char* name) {
    return std::ranges::any_of(columns, [&](const CloudColumn& column) { return column.name == name; });
  };
  if (has("x") || has("y") || has("z") || !has("X") || !has("Y") || !has("Z")) return;
  for (CloudColumn& column : columns) {
    if (column.name == "X" || column.name == "Y" || column.name == "Z") column.name = base::to_lower(column.name);
  }
}

}  // namespace

CloudColumns::CloudColumns(std::vector<CloudColumn> columns, std::size_t points, std::string where)
    : where_(std::move(where)) {
  name_axes_in_lower_case(columns);
  std::set<std::string> names;
  for (const CloudColumn& column : columns) {
    if (!names.insert(column.name).second) throw InputError(where_, "the property '" + column.name + "' occurs twice");
    targets_.push_back(target_of(column));
  }
  for (const char* axis : {"x", "y", "z"}) {
    if (!names.contains(axis)) throw InputError(where_, std::string("the points have no property '") + axis + "'");
  }
  allocate(points, columns);
}

CloudColumns::Target CloudColumns::target_of(const CloudColumn& column) {
  static const std::vector<std::vector<std::string>> kNormalNames = {{"nx", "ny", "nz"},
                                                                     {"normal_x", "normal_y", "normal_z"}};
  static const std::vector<std::vector<std::string>> kColorNames = {
      {"red", "green", "blue"}, {"r", "g", "b"}, {"diffuse_red", "diffuse_green", "diffuse_blue"}};
  if (const int axis = position_in({"x", "y", "z"}, column.name); axis >= 0) return {Kind::kPosition, axis};
  for (const auto& names : kNormalNames) {
    if (const int axis = position_in(names, column.name); axis >= 0) return {Kind::kNormal, axis};
  }
  for (const auto& names : kColorNames) {
    const int channel = position_in(names, column.name);
    if (channel >= 0) return {Kind::kColor, channel, scale_of(column.color_range)};
  }
  if (column.name == "rgb" || column.name == "rgba") return {Kind::kPackedColor};
  if (column.name == "alpha") return {Kind::kIgnored};
  return {Kind::kScalar};
}

void CloudColumns::allocate(std::size_t points, const std::vector<CloudColumn>& columns) {
  cloud_.positions.resize(points);
  for (std::size_t i = 0; i < targets_.size(); ++i) {
    Target& target = targets_[i];
    if (target.kind == Kind::kNormal) cloud_.normals.resize(points, Eigen::Vector3f::Zero());
    if (target.kind == Kind::kColor || target.kind == Kind::kPackedColor) cloud_.colors.resize(points);
    if (target.kind == Kind::kScalar) {
      target.scalar = &cloud_.scalars[columns[i].name];
      target.scalar->resize(points);
    }
  }
}

void CloudColumns::set_color(const Target& target, std::size_t point, double value) {
  const double byte = std::round(value * target.color_scale);
  cloud_.colors[point][static_cast<std::size_t>(target.axis)] =
      static_cast<std::uint8_t>(byte > 0.0 ? std::min(byte, 255.0) : 0.0);
}

void CloudColumns::set_packed_color(std::size_t point, std::uint32_t argb) {
  cloud_.colors[point] = {static_cast<std::uint8_t>(argb >> 16), static_cast<std::uint8_t>(argb >> 8),
                          static_cast<std::uint8_t>(argb)};
}

PointCloud CloudColumns::take_valid() {
  std::vector<bool> valid(cloud_.size());
  for (std::size_t i = 0; i < cloud_.size(); ++i) valid[i] = cloud_.positions[i].allFinite();
  cloud_ = filter_points(cloud_, valid);
  return take();
}

PointCloud CloudColumns::take(std::size_t first) {
  for (std::size_t i = 0; i < cloud_.size(); ++i) {
    if (!cloud_.positions[i].allFinite()) {
      throw InputError(where_,
                       "the position of point " + std::to_string(first + i) + " is not finite: remove such points");
    }
  }
  for (std::size_t i = 0; i < cloud_.normals.size(); ++i) {
    if (!cloud_.normals[i].allFinite()) {
      throw InputError(where_,
                       "the normal of point " + std::to_string(first + i) + " is not finite: remove such points");
    }
  }
  return std::move(cloud_);
}

}  // namespace tileflight::geometry
