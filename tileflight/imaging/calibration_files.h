#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "tileflight/imaging/camera.h"

namespace tileflight::imaging {

/// The forms of calibration files that read_calibration knows.
enum class CalibrationForm { kKalibr, kOpenCv, kColmap, kDso };

/// By the text alone; nullopt for a text that is none of them. What is told apart may still be broken.
std::optional<CalibrationForm> calibration_form(std::string_view text);

/// The cameras that a calibration file names: cam0, cam1, ... of Kalibr's camchain, CAMERA_IDs of COLMAP's cameras.txt,
/// in the file's order; empty for forms that hold one without a name. Throws InputError.
std::vector<std::string> camera_ids(const std::filesystem::path& file);

/// The camera of this name; an empty name is the only camera of the file. Throws InputError (file, the names that there
/// are): several cameras and none named, a name that is not there.
Calibration read_calibration(const std::filesystem::path& file, const std::string& camera_id);

/// Kalibr's camchain as read_kalibr has it, the camera of this name ("cam1"). T_cam_imu of a later camera that has none
/// of its own is that of the one before it, moved by T_cn_cnm1. Throws InputError.
Calibration read_kalibr_camera(const std::filesystem::path& file, const std::string& camera_id);

/// OpenCV's FileStorage as YAML or XML, and ROS's camera_info YAML: camera_matrix (cameraMatrix, K),
/// distortion_coefficients (distCoeffs, D), image_width and image_height (width and height, image_size), and
/// distortion_model (plumb_bob, rational_polynomial, equidistant, fisheye) or fisheye_model (0 or 1). Four numbers are
/// k1 k2 p1 p2 or, of the fisheye module, k1 k2 k3 k4: a file with four must say which. More are read where all beyond
/// k1 k2 p1 p2 are 0. Pixel centres are at integers, as here. Throws InputError (file, key, cause, cure).
Calibration read_opencv(const std::filesystem::path& file);

/// COLMAP's cameras.txt: SIMPLE_PINHOLE, PINHOLE, SIMPLE_RADIAL, RADIAL, OPENCV, FULL_OPENCV (k3 to k6 must be 0),
/// OPENCV_FISHEYE, SIMPLE_RADIAL_FISHEYE, RADIAL_FISHEYE, FOV. COLMAP's pixel centres are at halves, ours at integers.
/// The camera is the one with this CAMERA_ID, else the only one. Throws InputError (file, line, cause, cure): several
/// cameras and none named, a name that is not there, a model that is not known.
Calibration read_colmap_cameras(const std::filesystem::path& file, std::optional<std::int64_t> camera_id = {});

}  // namespace tileflight::imaging
