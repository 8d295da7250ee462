#pragma once

#include <yaml-cpp/yaml.h>

#include <array>
#include <filesystem>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/geometry/transform.h"

/// Values of calibration files of other programs. Their files may hold any further keys, so they are not read as strict
/// sections. `file` is for messages. All throw InputError (file, line or key, cause).
namespace tileflight::imaging {

/// Parses a YAML file. OpenCV's own first line, "%YAML:1.0", is left out: YAML requires "%YAML 1.0".
YAML::Node load_calibration_yaml(const std::filesystem::path& file);

/// The value of a key that a camera must have.
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

/// A list of numbers; empty for a key without a value.
std::vector<double> yaml_numbers(const YAML::Node& node, const std::string& key, const std::string& file);

/// Width and height of the images, pixels. `key` is for the message.
std::array<int, 2> checked_image_size(std::span<const double> sides, const std::string& key, const std::string& file);

/// A rigid motion from a 4x4 matrix, row by row; rotations of few digits are accepted. `key` is for the message.
geometry::SE3 checked_rigid_motion(std::span<const double> rows, const std::string& key, const std::string& file);

}  // namespace tileflight::imaging
