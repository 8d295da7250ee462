#include "tileflight/core/imaging/calibration_checks.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <numbers>
#include <optional>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/strict_section.h"
#include "tileflight/core/base/text_parsing.h"

namespace tileflight::imaging {

namespace {

/// The line with a blank behind the colon of its key.
std::string with_blank_behind_key(std::string_view line) {
  const std::size_t begin = line.find_first_not_of(" \t");
  if (begin == std::string_view::npos) return std::string(line);
  const auto ends_key = [](char c) { return std::isalnum(static_cast<unsigned char>(c)) == 0 && c != '_' && c != '.'; };
  const auto colon = std::find_if(line.begin() + static_cast<std::ptrdiff_t>(begin), line.end(), ends_key);
  const auto behind = static_cast<std::size_t>(colon - line.begin()) + 1;
  const bool has_key = colon != line.end() && *colon == ':' && behind > begin + 1 && behind < line.size();
  if (!has_key || std::string_view(" \t\r").find(line[behind]) != std::string_view::npos) return std::string(line);
  return std::string(line.substr(0, behind)) + " " + std::string(line.substr(behind));
}

}  // namespace

std::string plain_yaml(const std::string& text) {
  if (!text.starts_with('%')) return text;
  std::string_view rest = text;
  base::take_line(rest);
  std::string yaml = "\n";
  while (const auto line = base::take_line(rest)) yaml += with_blank_behind_key(*line) + "\n";
  return yaml;
}

namespace {

bool is_document_end(std::string_view line) {
  line = base::trim(line);
  return line == "---" || line == "...";
}

/// A document and the line that it begins with.
struct YamlDocument {
  std::string text, content;  ///< content: without comments and ROS's `header`
  int line = 0;
};

/// Takes the next document with content from the front of a text; nullopt at its end.
std::optional<YamlDocument> take_document(std::string_view& rest, int& line_number) {
  YamlDocument document{.line = line_number + 1};
  bool in_header = false;
  while (const auto line = base::take_line(rest)) {
    ++line_number;
    if (is_document_end(*line) && !document.content.empty()) return document;
    document.text += std::string(*line) + "\n";
    const std::string_view plain = base::trim(*line);
    if (plain.empty() || plain.starts_with('#') || plain.starts_with('%') || is_document_end(plain)) continue;
    in_header = line->starts_with("header:") || (in_header && (line->starts_with(' ') || line->starts_with('\t')));
    if (!in_header) document.content += std::string(plain) + "\n";
  }
  return document.content.empty() ? std::nullopt : std::optional(document);
}

}  // namespace

CalibrationText read_calibration_text(const std::filesystem::path& file) {
  std::string text = base::read_text(file, kMaxJsonBytes);
  CalibrationText result;
  if (!base::trim(text).starts_with('<')) {
    std::string_view rest = text;
    int line = 0;
    const std::optional<YamlDocument> first = take_document(rest, line);
    while (const auto next = take_document(rest, line)) {
      if (next->content != first->content)
        throw InputError(file.string(), "line " + std::to_string(next->line) +
                                            ": a second calibration begins, which differs from the first: keep one");
      ++result.documents;
    }
    if (result.documents > 1) text = first->text;
  }
  if (text.size() > kMaxCalibrationBytes)
    throw InputError(file.string(), "is larger than the limit of " + std::to_string(kMaxCalibrationBytes) + " bytes");
  result.text = std::move(text);
  return result;
}

YAML::Node load_calibration_yaml(const std::filesystem::path& file) {
  const std::string text = plain_yaml(read_calibration_text(file).text);
  try {
    YAML::Node root = YAML::Load(text);
    base::require_unique_keys(root, file);
    return root;
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

geometry::SE3 yaml_rigid_motion(const YAML::Node& node, const std::string& key, const std::string& file) {
  const YAML::Node rows = node.IsMap() ? node["data"] : node;
  std::vector<double> values;
  if (rows && rows.IsSequence() && rows.size() == 4) {
    for (const YAML::Node& row : rows) {
      const std::vector<double> part = yaml_numbers(row, key, file);
      if (part.size() != 4) throw InputError(file, "\"" + key + "\" must have 4 rows of 4 numbers");
      values.insert(values.end(), part.begin(), part.end());
    }
  } else if (rows) {
    values = yaml_numbers(rows, key, file);
  }
  return checked_rigid_motion(values, key, file);
}

namespace {

struct ExtrinsicsKey {
  const char* name;
  bool maps_to_camera;
};
constexpr std::array<ExtrinsicsKey, 7> kExtrinsicsKeys{{{"T_cam_imu", true},
                                                        {"T_imu_cam", false},
                                                        {"T_BS", false},
                                                        {"T_SC", false},
                                                        {"body_T_cam0", false},
                                                        {"Tbc", false},
                                                        {"IMU.T_b_c1", false}}};

/// VINS-Mono's pose of the camera in the IMU's frame: two matrices.
geometry::SE3 read_vins_extrinsics(const YAML::Node& camera, const std::string& file) {
  const auto numbers = [&](const char* key, std::size_t count) {
    const YAML::Node node = required_value(camera, key, file);
    const std::vector<double> values = yaml_numbers(node.IsMap() ? node["data"] : node, key, file);
    if (values.size() != count)
      throw InputError(file, "\"" + std::string(key) + "\" must have " + std::to_string(count) + " numbers");
    return values;
  };
  const std::vector<double> r = numbers("extrinsicRotation", 9), t = numbers("extrinsicTranslation", 3);
  return checked_rigid_motion(
      std::array{r[0], r[1], r[2], t[0], r[3], r[4], r[5], t[1], r[6], r[7], r[8], t[2], 0.0, 0.0, 0.0, 1.0},
      "extrinsicRotation", file);
}

}  // namespace

void read_extrinsics(const YAML::Node& camera, const std::string& file, Calibration& calibration) {
  for (const auto& [name, maps_to_camera] : kExtrinsicsKeys) {
    const YAML::Node node = camera[name];
    if (!node) continue;
    const geometry::SE3 T = yaml_rigid_motion(node, name, file);
    calibration.T_cam_imu = maps_to_camera ? T : T.inverse();
    return;
  }
  if (camera["extrinsicRotation"]) {
    calibration.T_cam_imu = read_vins_extrinsics(camera, file).inverse();
    return;
  }
  calibration.assumes_T_cam_imu = true;
}

bool states_extrinsics(const YAML::Node& camera) {
  return camera["extrinsicRotation"] ||
         std::ranges::any_of(kExtrinsicsKeys, [&](const ExtrinsicsKey& key) { return camera[key.name].IsDefined(); });
}

void note_unused_keys(const YAML::Node& camera, std::span<const std::string_view> known, const std::string& file,
                      Calibration& calibration) {
  std::string names;
  for (const auto& entry : camera) {
    if (!entry.first.IsScalar()) continue;
    const std::string& key = entry.first.Scalar();
    const bool is_extrinsics = std::ranges::any_of(kExtrinsicsKeys, [&](const auto& one) { return one.name == key; });
    if (is_extrinsics || std::ranges::find(known, key) != known.end()) continue;
    names += (names.empty() ? "" : ", ") + key.substr(0, 60);
  }
  if (!names.empty()) calibration.notes.push_back(file + ": keys that are not used: " + names);
}

namespace {

void require_count(const std::string& file, const std::string& what, std::size_t wanted, std::size_t found) {
  if (wanted == found) return;
  throw InputError(file, what + " must have " + std::to_string(wanted) + " numbers, not " + std::to_string(found));
}

void require_finite(const std::string& file, const std::string& what, std::span<const double> values) {
  if (std::all_of(values.begin(), values.end(), [](double value) { return std::isfinite(value); })) return;
  throw InputError(file, what + " must be finite numbers");
}

void require_coefficient_count(const std::string& file, const std::string& distortion, std::size_t found) {
  const std::string what = "distortion coefficients of \"" + distortion + "\"";
  if (distortion == "rational") {
    if (found != 5 && found != 8 && found != 12)
      throw InputError(file, what + " must have 5, 8 or 12 numbers (k1 k2 p1 p2 k3 [k4 k5 k6 [s1 s2 s3 s4]]), not " +
                                 std::to_string(found));
  } else if (distortion == "radtan" || distortion == "equidistant") {
    require_count(file, what, 4, found);
  } else if (distortion == "fov") {
    require_count(file, what, 1, found);
  } else if (distortion == "none") {
    require_count(file, what, 0, found);
  } else {
    throw InputError(
        file, "distortion model \"" + distortion + "\" is unknown: use radtan, rational, equidistant, fov or none");
  }
}

void check_focal(const std::string& file, const LensParameters& numbers) {
  require_count(file, "intrinsics", sphere_parameter_count(file, numbers.model) + 4,
                numbers.sphere_parameters.size() + numbers.intrinsics.size());
  require_finite(file, "intrinsics", numbers.intrinsics);
  if (!(numbers.intrinsics[0] > 0.0 && numbers.intrinsics[1] > 0.0))
    throw InputError(file, "focal lengths must be above 0 pixels");
  if (numbers.width <= 0 || numbers.height <= 0 || numbers.width > kMaxImageSide_px ||
      numbers.height > kMaxImageSide_px)
    throw InputError(file, "resolution must be two numbers from 1 to " + std::to_string(kMaxImageSide_px));
}

void check_distortion(const std::string& file, const LensParameters& numbers) {
  const std::span<const double> k = numbers.distortion_coefficients;
  require_coefficient_count(file, numbers.distortion, k.size());
  require_finite(file, "distortion coefficients", k);
  if (numbers.distortion == "fov" && !(k[0] >= 0.0 && k[0] < std::numbers::pi))
    throw InputError(file, "the field-of-view parameter must be from 0 to below pi radians");
  const bool takes = numbers.model == "pinhole" || numbers.distortion == "none" ||
                     (numbers.model == "omni" && numbers.distortion == "radtan");
  if (!takes)
    throw InputError(file, "camera model \"" + numbers.model + "\" with distortion \"" + numbers.distortion +
                               "\" is not supported: use " + (numbers.model == "omni" ? "radtan or none" : "none"));
}

void check_sphere(const std::string& file, const LensParameters& numbers) {
  const std::span<const double> s = numbers.sphere_parameters;
  require_finite(file, "intrinsics", s);
  const auto alpha_holds = [](double alpha) { return alpha >= 0.0 && alpha <= 1.0; };
  if (numbers.model == "omni" && !(s[0] >= 0.0)) throw InputError(file, "xi of \"omni\" must be 0 or more");
  if (numbers.model == "ds" && !(s[0] > -1.0 && alpha_holds(s[1])))
    throw InputError(file, "\"ds\" must have xi above -1 and alpha from 0 to 1");
  if (numbers.model == "eucm" && !(alpha_holds(s[0]) && s[1] > 0.0))
    throw InputError(file, "\"eucm\" must have alpha from 0 to 1 and beta above 0");
}

/// Pads the missing coefficients with zeros.
template <std::size_t N>
std::array<double, N> padded(std::span<const double> values) {
  std::array<double, N> out{};
  std::copy_n(values.begin(), std::min(N, values.size()), out.begin());
  return out;
}

CameraModel checked_model(const LensParameters& numbers) {
  const std::span<const double> f = numbers.intrinsics;
  const std::span<const double> k = numbers.distortion_coefficients;
  const std::span<const double> s = numbers.sphere_parameters;
  if (numbers.model == "omni") return UnifiedModel{f[0], f[1], f[2], f[3], s[0], padded<4>(k)};
  if (numbers.model == "ds") return DoubleSphere{f[0], f[1], f[2], f[3], s[0], s[1]};
  if (numbers.model == "eucm") return ExtendedUnifiedModel{f[0], f[1], f[2], f[3], s[0], s[1]};
  if (numbers.distortion == "equidistant") return KannalaBrandt{f[0], f[1], f[2], f[3], padded<4>(k)};
  if (numbers.model == "equirectangular") return Equirectangular{f[0], f[1], f[2], f[3]};
  if (numbers.distortion == "rational") return PinholeRational{f[0], f[1], f[2], f[3], padded<12>(k)};
  if (numbers.distortion == "fov") return FovModel{f[0], f[1], f[2], f[3], k[0]};
  return PinholeRadtan{f[0], f[1], f[2], f[3], padded<4>(k)};
}

}  // namespace

std::size_t sphere_parameter_count(const std::string& file, const std::string& model) {
  if (model == "pinhole" || model == "equirectangular") return 0;
  if (model == "omni") return 1;
  if (model == "ds" || model == "eucm") return 2;
  throw InputError(file, "camera model \"" + model +
                             "\" is not supported: use pinhole (with radtan, rational, equidistant, fov or none), omni "
                             "(with radtan or none), ds, eucm or equirectangular");
}

Camera make_camera(const std::string& file, const LensParameters& numbers) {
  check_focal(file, numbers);
  check_distortion(file, numbers);
  check_sphere(file, numbers);
  return {checked_model(numbers), numbers.width, numbers.height};
}

NamedDistortion parse_opencv_distortion(const std::string& where, std::span<const double> coefficients) {
  constexpr std::array<std::size_t, 6> kCounts{0, 4, 5, 8, 12, 14};
  constexpr std::size_t kWithoutTilt = 12;
  const std::size_t count = coefficients.size();
  if (std::find(kCounts.begin(), kCounts.end(), count) == kCounts.end())
    throw InputError(where, "must have 0, 4, 5, 8, 12 or 14 numbers, not " + std::to_string(count));
  for (std::size_t i = kWithoutTilt; i < count; ++i)
    if (coefficients[i] != 0.0)
      throw InputError(where, (i == kWithoutTilt ? "tx is " : "ty is ") + format_number(coefficients[i]) +
                                  ", but tilted sensors are not supported: calibrate without "
                                  "CALIB_TILTED_MODEL");
  const auto all = padded<kWithoutTilt>(coefficients);
  const bool brown_conrady = std::all_of(all.begin() + 4, all.end(), [](double value) { return value == 0.0; });
  if (brown_conrady) return {"radtan", {all.begin(), all.begin() + 4}};
  return {"rational", {all.begin(), all.end()}};
}

std::string format_number(double value) {
  std::string text;
  base::append_number(text, value);
  // YAML 1.1 readers (PyYAML, and so Kalibr's own tools) read "1e-08" as a string; "1.0e-08" is a number for all.
  const std::size_t exponent = text.find('e');
  if (exponent != std::string::npos && text.find('.') == std::string::npos) text.insert(exponent, ".0");
  return text;
}

std::string number_list(std::span<const double> values) {
  std::string text = "[";
  for (const double value : values) text += (text.size() > 1 ? ", " : "") + format_number(value);
  return text + "]";
}
std::string number_list(std::initializer_list<double> values) {
  return number_list(std::span(values.begin(), values.size()));
}

}  // namespace tileflight::imaging
