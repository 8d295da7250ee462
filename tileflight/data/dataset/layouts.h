#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "tileflight/data/dataset/dataset.h"

namespace tileflight::dataset {

/// A calibration for images of a given size.
struct ScaledCalibration {
  imaging::Calibration calibration;
  std::string scaled_from;  ///< the image size of the file, "1920x1080"; empty if it equals that of the images
};

/// Returns an image size as text, "1920x1080", for messages.
std::string size_text(int width, int height);

/// Reads the file's camera for images of this size, scaled (with a note) if only the aspect ratio is the same.
/// `camera_id`: which of several cameras in the file, else empty. Throws InputError: another aspect ratio, and errors
/// of imaging::read_calibration.
ScaledCalibration read_scaled_calibration(const std::filesystem::path& file, const std::string& camera_id, int width,
                                          int height, std::vector<std::string>& notes);

/// Scales a calibration that has been read, as read_scaled_calibration() does. `name`: the file, for messages.
ScaledCalibration scaled_calibration(const std::string& name, imaging::Calibration calibration, int width, int height,
                                     std::vector<std::string>& notes);

/// The warning for readings of an inertial unit of which no calibration says how it is mounted.
std::string unstated_mount_text(const std::string& where);

}  // namespace tileflight::dataset

/// One reader for each layout of a folder that read_dataset knows. All throw InputError (file, line, cause).
namespace tileflight::dataset::layouts {

/// Reads the chosen camera (`camera.calibration` is not empty) for images of the size of the dataset's first frame.
/// Tolerated problems are added to the dataset's warnings.
imaging::Calibration read_chosen_camera(const CameraChoice& camera, Dataset& dataset);

/// Returns the frames whose image exists. `file`: the list that named them; those left out are counted in a warning.
/// Throws InputError if none is left, or their times do not increase.
std::vector<Frame> existing_frames(std::vector<Frame> named, const std::filesystem::path& file,
                                   std::vector<std::string>& warnings);

/// Resolves a file that a list of the layout names relative to the dataset's folder. Throws InputError(where, cause)
/// for a path that leads out of the folder.
std::filesystem::path file_within(const std::filesystem::path& folder, std::string_view name, const std::string& where);

/// Reads images/, our own layout and DSO's.
Dataset read_images_folder(const std::filesystem::path& folder, const CameraChoice& camera);

/// Recognize and read image_l/ or image_0/ (KITTI odometry).
bool is_kitti(const std::filesystem::path& folder);
Dataset read_kitti(const std::filesystem::path& folder, const CameraChoice& camera);
/// Returns the names of KITTI's folders of images, the left one first; empty if there is only one.
std::vector<std::string> kitti_cameras(const std::filesystem::path& folder);
/// Returns T_first_camera of one of these cameras, from the projection matrices of calib.txt.
geometry::SE3 kitti_mount(const std::filesystem::path& folder, const std::string& camera);

/// Recognize and read rgb.csv (VSLAM-LAB).
bool is_vslam_lab(const std::filesystem::path& folder);
Dataset read_vslam_lab(const std::filesystem::path& folder, const CameraChoice& camera);
/// Returns rgb_0, rgb_1 and so on; empty if there is only one camera.
std::vector<std::string> vslam_lab_cameras(const std::filesystem::path& folder);
/// Returns T_body_camera of one of these cameras, which is its T_BS.
geometry::SE3 vslam_lab_mount(const std::filesystem::path& folder, const std::string& camera);

/// Recognize and read rgb.txt (TUM RGB-D).
bool is_tum_rgbd(const std::filesystem::path& folder);
Dataset read_tum_rgbd(const std::filesystem::path& folder, const CameraChoice& camera);

/// Recognize and read mav0/cam0/ or cam0/ (EuRoC, ASL layout).
bool is_euroc(const std::filesystem::path& folder);
Dataset read_euroc(const std::filesystem::path& folder, const CameraChoice& camera);
/// Returns cam0, cam1 and so on; empty if there is only one camera.
std::vector<std::string> euroc_cameras(const std::filesystem::path& folder);

}  // namespace tileflight::dataset::layouts
