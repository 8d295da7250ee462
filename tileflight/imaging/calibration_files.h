#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "tileflight/imaging/camera.h"

namespace tileflight::imaging {

/// Calibration file formats supported by read_calibration.
enum class CalibrationFormat { kKalibr, kOpenCv, kColmap, kDso };

/// Detects the format from the text; nullopt for an unknown format. A detected file may still be malformed.
std::optional<CalibrationFormat> detect_calibration_format(std::string_view text);

/// Names of the cameras in a calibration file: cam0, cam1, ... of Kalibr's camchain, CAMERA_IDs of COLMAP's
/// cameras.txt, in file order; empty for formats that hold one unnamed camera. Throws InputError.
std::vector<std::string> camera_ids(const std::filesystem::path& file);

/// Reads the camera of this name; an empty name selects the only camera of the file. Throws InputError (file, available
/// names) if several cameras exist and none is named, or if the name does not exist.
Calibration read_calibration(const std::filesystem::path& file, const std::string& camera_id);

/// Reads one camera ("cam1") of a Kalibr camchain, as read_kalibr. If a later camera has no T_cam_imu, it is derived
/// from that of the preceding camera and T_cn_cnm1. Throws InputError.
Calibration read_kalibr_camera(const std::filesystem::path& file, const std::string& camera_id);

/// Reads OpenCV's FileStorage as YAML or XML, and ROS's camera_info YAML: camera_matrix (cameraMatrix, K),
/// distortion_coefficients (distCoeffs, D), image_width and image_height (width and height, image_size), and
/// distortion_model (plumb_bob, rational_polynomial, equidistant, fisheye) or fisheye_model (0 or 1). Four coefficients
/// are k1 k2 p1 p2 or, of the fisheye module, k1 k2 k3 k4: a file with four must state the model. Longer lists are
/// accepted if all beyond k1 k2 p1 p2 are 0. Pixel centres are at integers, as here. Throws InputError (file, key,
/// cause, cure).
Calibration read_opencv(const std::filesystem::path& file);

/// Reads COLMAP's cameras.txt: SIMPLE_PINHOLE, PINHOLE, SIMPLE_RADIAL, RADIAL, OPENCV, FULL_OPENCV (k3 to k6 must be
/// 0), OPENCV_FISHEYE, SIMPLE_RADIAL_FISHEYE, RADIAL_FISHEYE, FOV. COLMAP's pixel centres are at half-integers; they
/// are converted to ours, at integers. Selects the camera with this CAMERA_ID, or the only one. Throws InputError
/// (file, line, cause, cure): several cameras and none selected, no such camera, an unknown model.
Calibration read_colmap_cameras(const std::filesystem::path& file, std::optional<std::int64_t> camera_id = {});

}  // namespace tileflight::imaging
