#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "tileflight/core/imaging/camera.h"

namespace tileflight::imaging {

/// Calibration file formats supported by read_calibration.
enum class CalibrationFormat { kKalibr, kOpenCv, kColmap, kDso, kVslamLab, kVins, kAgisoft, kJson, kEuroc };

/// Detects the format from the text; nullopt for an unknown format. A detected file may still be malformed.
std::optional<CalibrationFormat> detect_calibration_format(std::string_view text);

/// Returns the names of the cameras in a calibration file: cam0, cam1, ... of Kalibr's camchain, CAMERA_IDs of COLMAP's
/// cameras, rgb_0, rgb_1, ... of VSLAM-LAB and ORB-SLAM3, OpenSfM's names, in file order; empty for formats that hold
/// one unnamed camera. Throws InputError.
std::vector<std::string> camera_ids(const std::filesystem::path& file);

/// Reads the camera of this name; an empty name selects the only camera of the file. Throws InputError (file, available
/// names) if several cameras exist and none is named, or if the name does not exist.
Calibration read_calibration(const std::filesystem::path& file, const std::string& camera_id);

/// Reads one camera ("cam1") of a Kalibr camchain, as read_kalibr. If a later camera has no T_cam_imu, it is derived
/// from that of the preceding camera and T_cn_cnm1. Throws InputError.
Calibration read_kalibr_camera(const std::filesystem::path& file, const std::string& camera_id);

/// A camera of a Kalibr camchain, on the body that carries the chain.
struct ChainCamera {
  std::string name;              ///< "cam0" or, in camchains written here, its key `name`
  std::filesystem::path folder;  ///< folder of its images: key `folder` of camchains written here; else empty
  Calibration calibration;
  /// Camera to body: key `T_body_cam` of camchains written here. Without it the body is the first camera, and the poses
  /// are those of T_cn_cnm1 or, where that is missing, of T_cam_imu.
  geometry::SE3 T_body_cam;
  double timeshift_cam_imu_s = 0.0;  ///< time on the body's clock = time stamp of the image + this
};

/// Reads all cameras of a Kalibr camchain: cam0, cam1, and so on, each as read_kalibr_camera. Throws InputError (file,
/// camera, key, cause): a camera of which neither T_cn_cnm1 nor T_cam_imu says where it is, both with different
/// statements, one more than 10 m away from the one before or the IMU (millimetres), a time shift of more than a
/// second, a number left out.
std::vector<ChainCamera> read_camchain(const std::filesystem::path& file);

/// Writes a camchain for Kalibr's users, with T_cn_cnm1 and T_cam_imu of each, which read_camchain reads again.
void write_camchain(const std::filesystem::path& file, const std::vector<ChainCamera>& cameras);

/// Reads OpenCV's FileStorage as YAML or XML, and ROS's camera_info YAML: camera_matrix (cameraMatrix, K),
/// distortion_coefficients (distCoeffs, D), image_width and image_height (width and height, image_size), and
/// distortion_model (plumb_bob, rational_polynomial, equidistant, fisheye) or fisheye_model (0 or 1). Four coefficients
/// are k1 k2 p1 p2 or, of the fisheye module, k1 k2 k3 k4: a file with four must state the model. With xi the lens is
/// that of the omnidir module. A camera_info whose images are a part of the sensor's (roi) or have joined pixels
/// (binning_x, binning_y) gives the camera of these images. Pixel centres are at integers, as here. Throws InputError
/// (file, key, cause, cure).
Calibration read_opencv(const std::filesystem::path& file);

/// Reads a camera's sensor.yaml of EuRoC's layout: intrinsics, distortion_model (radial-tangential or equidistant),
/// distortion_coefficients, resolution, T_BS. Throws InputError (file, cause).
Calibration read_euroc_sensor(const std::filesystem::path& file);

/// Returns whether an XML text is a calibration of Agisoft's Metashape.
bool is_agisoft_calibration(std::string_view text);

/// Reads a calibration of Agisoft's Metashape ("Agisoft XML"): projections frame, fisheye and spherical, f cx cy b1, k1
/// to k3 (of fisheye: to k4), p1 p2. Throws InputError (file, key, cause): b2, p3, p4, k4 of a frame camera, unless 0.
Calibration read_agisoft(const std::filesystem::path& file);

/// Reads a calibration of VINS-Mono or VINS-Fusion: model_type PINHOLE, PINHOLE_FULL, MEI, KANNALA_BRANDT, in the file
/// or in the one that its cam0_calib names; extrinsics where they are stated. Throws InputError (file, key, cause).
Calibration read_vins(const std::filesystem::path& file);

/// A camera with the name that its file gives it.
struct NamedCalibration {
  std::string name;  ///< empty: it has none
  Calibration calibration;
};

/// Reads all cameras of a calibration in JSON: OpenSfM's camera_models.json and OpenDroneMap's cameras.json, basalt's
/// calibration.json, nerfstudio's transforms.json, Gyroflow's lens profiles (lens_profile.h). Throws InputError (file,
/// key, cause) for other JSON, and for models without a counterpart here.
std::vector<NamedCalibration> read_json_calibrations(const std::filesystem::path& file);

/// Returns whether bytes are COLMAP's cameras.bin rather than text.
bool is_colmap_binary(std::string_view bytes);

/// Returns the text of cameras.txt; cameras.bin is converted to it. `file` is for messages. Throws InputError.
std::string colmap_text(std::string bytes, const std::string& file);

/// Reads COLMAP's cameras.txt or cameras.bin, all lens models: of THIN_PRISM_FISHEYE, RAD_TAN_THIN_PRISM_FISHEYE,
/// SIMPLE_DIVISION and DIVISION only those without the numbers that no lens model here has. COLMAP's pixel centres are
/// at half-integers; they are converted to ours, at integers.
/// Selects the camera with this CAMERA_ID, or the only one. Throws InputError (file, line, cause, cure): several
/// cameras and none selected, no such camera, an unknown model.
Calibration read_colmap_cameras(const std::filesystem::path& file, std::optional<std::int64_t> camera_id = {});

/// A camera of VSLAM-LAB's calibration.yaml.
struct VslamLabCamera {
  Calibration calibration;         ///< T_cam_imu from the T_BS of camera and first IMU; identity if the file has no IMU
  geometry::SE3 T_body_cam;        ///< T_BS, for poses of the body; identity if the file has none
  double depth_units_per_m = 0.0;  ///< depth_factor: of the 16-bit depth images; 0: none is stated
};

/// Reads a camera ("rgb_0") of VSLAM-LAB's calibration.yaml (https://github.com/VSLAM-LAB/VSLAM-LAB) in the form since
/// 2025-12, a list `cameras` whose entries have cam_name, focal_length, principal_point, distortion_type (radtan4,
/// radtan5, radtan8, equid4; also OKVIS2's names), image_dimension, T_BS; or in the forms before it, with the keys of
/// ORB-SLAM's settings (Camera.fx or Camera0.fx, IMU.T_b_c1). Throws InputError (file, key, cause).
VslamLabCamera read_vslam_lab_camera(const std::filesystem::path& file, const std::string& camera_id = "rgb_0");

/// Returns the names of the cameras in VSLAM-LAB's calibration.yaml, as camera_ids(). Throws InputError.
std::vector<std::string> vslam_lab_camera_ids(const std::filesystem::path& file);

/// Returns the entries of one camera that describe its lens and image size, in the present form: "cam_model: pinhole,
/// ...". nullopt for a lens that the form cannot describe.
std::optional<std::string> vslam_lab_lens_text(const Camera& camera);

}  // namespace tileflight::imaging
