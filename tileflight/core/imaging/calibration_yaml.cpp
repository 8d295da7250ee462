#include "tileflight/core/imaging/calibration_yaml.h"

#include <algorithm>
#include <cmath>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/imaging/calibration_checks.h"

namespace tileflight::imaging {

YAML::Node load_calibration_yaml(const std::filesystem::path& file) {
  std::string text = base::read_text(file, kMaxCalibrationBytes);
  // The line stays, empty, so that messages count lines as the file does.
  if (text.starts_with("%YAML:")) text.erase(0, std::min(text.find('\n'), text.size()));
  try {
    return YAML::Load(text);
  } catch (const YAML::Exception& error) {
    throw InputError(file.string(), "line " + std::to_string(error.mark.line + 1) + ": not valid YAML: " + error.msg);
  }
}

YAML::Node required_value(const YAML::Node& camera, const std::string& key, const std::string& file) {
  const YAML::Node node = camera[key];
  if (!node) throw InputError(file, "the camera has no key \"" + key + "\"");
  return node;
}

std::vector<double> yaml_numbers(const YAML::Node& node, const std::string& key, const std::string& file) {
  if (!node.IsSequence() && !node.IsNull())
    throw InputError(file,
                     "line " + std::to_string(node.Mark().line + 1) + ": \"" + key + "\" must be a list of numbers");
  std::vector<double> values;
  for (const YAML::Node& value : node) values.push_back(yaml_scalar<double>(value, key, file));
  return values;
}

std::array<int, 2> checked_image_size(std::span<const double> sides, const std::string& key, const std::string& file) {
  if (sides.size() != 2) throw InputError(file, "\"" + key + "\" must be width and height");
  const auto is_side = [](double value) {
    return value >= 1.0 && value <= kMaxImageSide_px && value == std::floor(value);
  };
  if (!is_side(sides[0]) || !is_side(sides[1]))
    throw InputError(file, "\"" + key + "\" must be two whole numbers from 1 to " + std::to_string(kMaxImageSide_px));
  return {static_cast<int>(sides[0]), static_cast<int>(sides[1])};
}

geometry::SE3 checked_rigid_motion(std::span<const double> rows, const std::string& key, const std::string& file) {
  if (rows.size() != 16) throw InputError(file, "\"" + key + "\" must have 4 rows of 4 numbers");
  const geometry::Mat4 m = Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(rows.data());
  const geometry::Mat3 rotation = m.topLeftCorner<3, 3>();
  constexpr double kRounding = 1e-3;  // files contain few digits
  const std::string not_rigid = "\"" + key + "\" is not a rigid motion (rotation and translation)";
  if (!m.allFinite() || !m.row(3).isApprox(Eigen::RowVector4d(0, 0, 0, 1), kRounding))
    throw InputError(file, not_rigid);
  const geometry::Mat3 product = rotation.transpose() * rotation;
  if (!product.isIdentity(kRounding))
    throw InputError(file, not_rigid + ": its 3x3 part is not orthonormal, but off by " +
                               base::rounded_text((product - geometry::Mat3::Identity()).cwiseAbs().maxCoeff(), 3));
  if (rotation.determinant() < 0) throw InputError(file, not_rigid + ": its 3x3 part is a reflection");
  return {rotation, m.topRightCorner<3, 1>()};
}

}  // namespace tileflight::imaging
