#pragma once

/// Values of calibration files of other programs. Their files may hold any further keys, so they are not read as strict
/// sections. `file` is for messages. All throw InputError (file, line or key, cause).

#include <yaml-cpp/yaml.h>

#include <array>
#include <cstdint>
#include <filesystem>
#include <initializer_list>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/geometry/transform.h"
#include "tileflight/core/imaging/camera.h"

namespace tileflight::imaging {

/// Returns the text of OpenCV's own YAML, which begins with "%YAML:1.0", as YAML; text without such a line as it is.
/// The first line becomes empty, since YAML requires "%YAML 1.0". A blank is put behind the colon of a key where the
/// file has none ("data:[1, 2]"), which OpenCV accepts. Lines stay where they are.
std::string plain_yaml(const std::string& text);

/// Parses a YAML file, OpenCV's own included.
YAML::Node load_calibration_yaml(const std::filesystem::path& file);

/// Returns the value of a key that a camera must have.
YAML::Node required_value(const YAML::Node& camera, const std::string& key, const std::string& file);

template <class T>
T yaml_scalar(const YAML::Node& node, const std::string& key, const std::string& file) {
  try {
    return node.as<T>();
  } catch (const YAML::Exception&) {
    throw InputError(file, "line " + std::to_string(node.Mark().line + 1) + ": \"" + key + "\" must be " +
                               (std::is_same_v<T, std::string> ? "a word" : "a number"));
  }
}

/// Reads a list of numbers; empty for a key without a value.
std::vector<double> yaml_numbers(const YAML::Node& node, const std::string& key, const std::string& file);

/// Checks the width and height of the images, pixels. `key` is for the message.
std::array<int, 2> checked_image_size(std::span<const double> sides, const std::string& key, const std::string& file);

/// Reads a rigid motion from a 4x4 matrix, row by row; rotations of few digits are accepted. `key` is for the message.
geometry::SE3 checked_rigid_motion(std::span<const double> rows, const std::string& key, const std::string& file);

/// Reads a rigid motion from a list of 16 numbers, from 4 lists of 4, or from OpenCV's matrix; as checked_rigid_motion.
geometry::SE3 yaml_rigid_motion(const YAML::Node& node, const std::string& key, const std::string& file);

/// Reads T_cam_imu under any of the names that programs give it: T_cam_imu (Kalibr); from camera to IMU T_imu_cam
/// (OpenVINS), T_BS (EuRoC), T_SC (OKVIS), body_T_cam0 and extrinsicRotation with extrinsicTranslation (VINS), Tbc and
/// IMU.T_b_c1 (ORB-SLAM3). If there is none, it is the identity, and `assumes_T_cam_imu` is set.
void read_extrinsics(const YAML::Node& camera, const std::string& file, Calibration& calibration);

/// Returns whether a camera states T_cam_imu under one of these names.
bool states_extrinsics(const YAML::Node& camera);

/// Adds a note about the keys of a camera that are not in `known`, if there are any.
void note_unused_keys(const YAML::Node& camera, std::span<const std::string_view> known, const std::string& file,
                      Calibration& calibration);

/// Largest image side accepted in a calibration, pixels.
inline constexpr int kMaxImageSide_px = 1 << 20;

/// Largest calibration file that is read, bytes.
inline constexpr std::uintmax_t kMaxCalibrationBytes = std::uintmax_t{1} << 20;

/// Largest calibration in JSON that is read, bytes: it may hold the poses of many images.
inline constexpr std::uintmax_t kMaxJsonBytes = std::uintmax_t{64} << 20;

/// Lens parameters of a calibration file, as plain numbers.
struct LensParameters {
  std::string distortion;              ///< radtan, rational, equidistant, fov or none
  std::span<const double> intrinsics;  ///< fx fy cx cy, pixels
  std::span<const double> distortion_coefficients;
  int width = 0, height = 0;
  std::string model = "pinhole";                ///< pinhole, omni, ds, eucm (Kalibr's names) or equirectangular
  std::span<const double> sphere_parameters{};  ///< of omni: xi; ds: xi alpha; eucm: alpha beta
};

/// Returns the number of parameters that precede fx fy cx cy in a model. Throws InputError(file, cause) for an unknown
/// name.
std::size_t sphere_parameter_count(const std::string& file, const std::string& model);

/// A calibration's text, up to the first `---` behind something.
struct CalibrationText {
  std::string text;
  std::size_t documents = 1;  ///< messages of a topic (`rostopic echo`), which state the same camera
};

/// Reads the text of a calibration. Of several YAML documents it gives the first, if the others differ from it by
/// ROS's `header` only. Throws InputError: documents that differ, or one of more than kMaxCalibrationBytes.
CalibrationText read_calibration_text(const std::filesystem::path& file);

/// Builds the camera after checking counts, finiteness and signs. Throws InputError(file, cause).
Camera make_camera(const std::string& file, const LensParameters& numbers);

/// A distortion model by name and coefficients, as in LensParameters.
struct NamedDistortion {
  std::string name;
  std::vector<double> coefficients;
};

/// Interprets OpenCV's coefficients k1 k2 p1 p2 [k3 [k4 k5 k6 [s1 s2 s3 s4 [tx ty]]]]: radtan if those beyond the
/// fourth are 0, otherwise rational; an empty list means zeros. Throws InputError(where, cause, cure) for another
/// count, or for a tilted sensor.
NamedDistortion parse_opencv_distortion(const std::string& where, std::span<const double> coefficients);

/// Returns the shortest text that reads back as the same number.
std::string format_number(double value);
/// Returns numbers as a YAML list, "[1, 2.5]", each by format_number().
std::string number_list(std::span<const double> values);
std::string number_list(std::initializer_list<double> values);

}  // namespace tileflight::imaging
