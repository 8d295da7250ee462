#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <array>
#include <cctype>

#include "tileflight/core/base/file_kind.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/core/imaging/calibration_checks.h"
#include "tileflight/core/imaging/calibration_files.h"

namespace tileflight::imaging {

namespace {

/// The next line that is neither blank nor a comment; empty at the end.
std::string_view next_line(std::string_view& text) {
  while (const auto line = base::take_line(text)) {
    const std::size_t begin = line->find_first_not_of(" \t");
    if (begin != std::string_view::npos && (*line)[begin] != '#') return line->substr(begin);
  }
  return {};
}

/// Whether a line is "cam0:" (or another number), possibly quoted or in braces.
bool begins_kalibr_camera(std::string_view line) {
  line.remove_prefix(std::min(line.find_first_not_of("{\"' "), line.size()));
  if (!line.starts_with("cam")) return false;
  line.remove_prefix(3);
  const std::size_t digits = std::min(line.find_first_not_of("0123456789"), line.size());
  line.remove_prefix(digits);
  line.remove_prefix(std::min(line.find_first_not_of("\"' "), line.size()));
  return digits > 0 && line.starts_with(':');
}

bool has_kalibr_camera(std::string_view text) {
  while (true) {
    const std::string_view line = next_line(text);
    if (line.empty()) return false;
    if (begins_kalibr_camera(line)) return true;
  }
}

/// Whether a line begins the list of cameras in VSLAM-LAB's form, or is a focal length in one of its earlier forms.
bool begins_vslam_lab_camera(std::string_view line) {
  if (line.starts_with("cameras:")) return true;
  if (!line.starts_with("Camera")) return false;
  line.remove_prefix(6);
  line.remove_prefix(std::min(line.find_first_not_of("0123456789"), line.size()));
  return line.starts_with(".fx");
}

bool has_vslam_lab_camera(std::string_view text) {
  while (true) {
    const std::string_view line = next_line(text);
    if (line.empty()) return false;
    if (begins_vslam_lab_camera(line)) return true;
  }
}

/// The consecutive names "cam0", "cam1", ... in the file.
std::vector<std::string> kalibr_ids(const std::filesystem::path& file, std::string_view text) {
  std::vector<std::string> ids;
  try {
    for (const auto& entry : YAML::Load(std::string(text))) {
      const auto key = entry.first.as<std::string>("");
      if (begins_kalibr_camera(key + ":")) ids.push_back(key);
    }
  } catch (const YAML::Exception& error) {
    throw InputError(file.string(), "line " + std::to_string(error.mark.line + 1) + ": not valid YAML: " + error.msg);
  }
  return ids;
}

/// Whether a JSON text has a key of the programs that json_calibrations.cpp reads or names.
bool is_json_calibration(std::string_view text) {
  constexpr std::array<std::string_view, 5> kKeys{"\"projection_type\"", "\"value0\"", "\"fl_x\"", "\"camera_angle_x\"",
                                                  "\"fisheye_params\""};
  return std::ranges::any_of(kKeys, [text](std::string_view key) { return text.find(key) != std::string_view::npos; });
}

bool has_line_that_begins(std::string_view text, std::string_view begin) {
  while (true) {
    const std::string_view line = next_line(text);
    if (line.empty()) return false;
    if (line.starts_with(begin)) return true;
  }
}

/// JSON may hold the poses of many images beside the lens; the readers of other forms have a lower limit.
std::string calibration_text(const std::filesystem::path& file) {
  const std::string head = base::read_head(file);
  if (const auto refusal = base::refusal_of_kind(head, "a calibration"); refusal && !is_colmap_binary(head))
    throw InputError(file.string(), *refusal);
  return base::read_text(file, kMaxJsonBytes);
}

std::vector<std::string> colmap_ids(std::string_view text) {
  std::vector<std::string> ids;
  while (true) {
    const std::string_view line = next_line(text);
    if (line.empty()) return ids;
    ids.emplace_back(base::split_fields(line).front());
  }
}

bool is_number(std::string_view field) { return base::parse_number<double>(field).has_value(); }

/// Whether the fields are CAMERA_ID MODEL ….
bool is_colmap_line(const std::vector<std::string_view>& fields) {
  return fields.size() > 1 && base::parse_number<std::int64_t>(fields[0]) && !is_number(fields[1]) &&
         std::isupper(static_cast<unsigned char>(fields[1].front())) != 0;
}

/// Whether the fields are numbers, possibly after a name.
bool is_dso_line(const std::vector<std::string_view>& fields) { return fields.size() > 1 && is_number(fields.back()); }

}  // namespace

std::optional<CalibrationFormat> detect_calibration_format(std::string_view text) {
  if (text.starts_with("\xEF\xBB\xBF")) text.remove_prefix(3);
  std::string_view rest = text;
  const std::string_view first = next_line(rest);
  if (is_colmap_binary(text)) return CalibrationFormat::kColmap;
  if (first.starts_with('<'))
    return is_agisoft_calibration(text) ? CalibrationFormat::kAgisoft : CalibrationFormat::kOpenCv;
  if ((first.starts_with('{') || first.starts_with('[')) && is_json_calibration(text)) return CalibrationFormat::kJson;
  if (first.starts_with("%YAML") || first.starts_with("---") || first.find(':') != std::string_view::npos) {
    if (has_kalibr_camera(text)) return CalibrationFormat::kKalibr;
    if (has_line_that_begins(text, "model_type:") || has_line_that_begins(text, "cam0_calib:"))
      return CalibrationFormat::kVins;
    if (has_line_that_begins(text, "sensor_type:")) return CalibrationFormat::kEuroc;
    return has_vslam_lab_camera(text) ? CalibrationFormat::kVslamLab : CalibrationFormat::kOpenCv;
  }
  const std::vector<std::string_view> fields = base::split_fields(first);
  if (is_colmap_line(fields)) return CalibrationFormat::kColmap;
  if (is_dso_line(fields)) return CalibrationFormat::kDso;
  return std::nullopt;
}

namespace {

const NamedCalibration& named(const std::vector<NamedCalibration>& cameras, const std::string& camera_id) {
  return *std::ranges::find(cameras, camera_id, &NamedCalibration::name);
}

InputError several_cameras(const std::filesystem::path& file, const std::vector<std::string>& ids) {
  return {file.string(), "holds " + std::to_string(ids.size()) + " cameras (" + base::joined(ids) +
                             "): choose the one that took the images (--camera-id)"};
}

}  // namespace

Calibration read_calibration(const std::filesystem::path& file) {
  const std::string text = calibration_text(file);
  const std::optional<CalibrationFormat> form = detect_calibration_format(text);
  if (!form && has_line_that_begins(text, "[image]") && has_line_that_begins(text, "camera matrix"))
    throw InputError(file.string(), "is ROS's ost.ini: give the ost.yaml that camera_calibration writes beside it");
  if (!form)
    throw InputError(
        file.string(),
        "unknown calibration format (expected a Kalibr camchain with \"cam0\", OpenCV's YAML or XML, "
        "COLMAP's cameras.txt or cameras.bin, DSO's camera.txt, the calibration of VSLAM-LAB, ORB-SLAM3, "
        "VINS, basalt, OpenSfM, OpenDroneMap or nerfstudio, Agisoft's XML, or a lens profile of Gyroflow)");
  switch (*form) {
    case CalibrationFormat::kKalibr:
      return read_kalibr(file);
    case CalibrationFormat::kOpenCv:
      return read_opencv(file);
    case CalibrationFormat::kColmap:
      return read_colmap_cameras(file);
    case CalibrationFormat::kVslamLab: {
      const std::vector<std::string> ids = vslam_lab_camera_ids(file);
      return read_vslam_lab_camera(file, ids.empty() ? "rgb_0" : ids.front()).calibration;
    }
    case CalibrationFormat::kVins:
      return read_vins(file);
    case CalibrationFormat::kEuroc:
      return read_euroc_sensor(file);
    case CalibrationFormat::kAgisoft:
      return read_agisoft(file);
    case CalibrationFormat::kJson: {
      const std::vector<NamedCalibration> cameras = read_json_calibrations(file);
      if (cameras.size() > 1) throw several_cameras(file, camera_ids(file));
      return cameras.front().calibration;
    }
    case CalibrationFormat::kDso:
      break;
  }
  Calibration calibration = read_dso_camera(file);
  calibration.assumes_T_cam_imu = true;
  return calibration;
}

std::vector<std::string> camera_ids(const std::filesystem::path& file) {
  const std::string text = calibration_text(file);
  const std::optional<CalibrationFormat> form = detect_calibration_format(text);
  if (form == CalibrationFormat::kKalibr) return kalibr_ids(file, text);
  if (form == CalibrationFormat::kColmap) return colmap_ids(colmap_text(text, file.string()));
  if (form == CalibrationFormat::kVslamLab) return vslam_lab_camera_ids(file);
  if (form != CalibrationFormat::kJson) return {};
  std::vector<std::string> ids;
  for (const NamedCalibration& camera : read_json_calibrations(file))
    if (!camera.name.empty()) ids.push_back(camera.name);
  return ids;
}

Calibration read_calibration(const std::filesystem::path& file, const std::string& camera_id) {
  const std::vector<std::string> ids = camera_ids(file);
  if (camera_id.empty() && ids.size() > 1) throw several_cameras(file, ids);
  if (camera_id.empty() && ids.size() == 1) return read_calibration(file, ids.front());
  if (camera_id.empty()) return read_calibration(file);
  if (ids.empty()) throw InputError(file.string(), "contains one camera without a name: leave --camera-id out");
  if (std::find(ids.begin(), ids.end(), camera_id) == ids.end())
    throw InputError(file.string(), "has no camera " + camera_id + ", only " + base::joined(ids));
  const std::optional<CalibrationFormat> form = detect_calibration_format(calibration_text(file));
  if (form == CalibrationFormat::kJson) return named(read_json_calibrations(file), camera_id).calibration;
  if (const auto number = base::parse_number<std::int64_t>(camera_id)) return read_colmap_cameras(file, *number);
  return form == CalibrationFormat::kVslamLab ? read_vslam_lab_camera(file, camera_id).calibration
                                              : read_kalibr_camera(file, camera_id);
}

}  // namespace tileflight::imaging
