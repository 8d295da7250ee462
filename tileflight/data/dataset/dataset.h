#pragma once

#include <cstddef>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "tileflight/core/geometry/geodesy.h"
#include "tileflight/core/geometry/trajectory.h"
#include "tileflight/core/imaging/camera.h"
#include "tileflight/core/imaging/image.h"

namespace tileflight::dataset {

/// An image of a dataset, with its time.
struct Frame {
  std::string id;  ///< "000000"
  std::filesystem::path image;
  double time_s = 0.0;
  double exposure_ms = 0.0;       ///< 0: unknown
  std::filesystem::path depth{};  ///< depth of the same pixels (frame_layers.h); empty: none
};

/// Position of the receiver at a time; a line of gps.csv: t,lat,lon,height,horizontal_sigma,vertical_sigma.
struct GpsFix {
  double time_s = 0.0;
  geometry::Geodetic position;
  double horizontal_sigma_m = 0.0;
  double vertical_sigma_m = 0.0;
};

/// A sensor dataset on disk (docs/formats.md). Images stay on disk; frames are in time order.
struct Dataset {
  std::filesystem::path folder;
  std::vector<Frame> frames;
  imaging::Calibration calibration;
  std::filesystem::path pcalib;    ///< empty if there is none
  std::filesystem::path vignette;  ///< empty if there is none
  std::optional<geometry::Trajectory> groundtruth;
  std::vector<GpsFix> gps;
  std::filesystem::path imu;                    ///< readings, for read_imu_csv(); empty if there are none
  std::filesystem::path imu_noise;              ///< for read_imu_noise(); empty if it is not known
  double depth_units_per_m = 1.0;               ///< of 16-bit depth images
  std::map<std::string, std::string> metadata;  ///< dataset.yaml, flattened: "a.b" -> text
  std::vector<std::string> warnings;  ///< tolerated problems, one line each (no times.txt, images left out, ...)
};

/// Chooses a camera of a dataset, or a calibration that replaces the one in its layout.
struct CameraChoice {
  /// Any format of imaging::read_calibration; empty: the dataset's own. If there is no such file, but the dataset has a
  /// camera of this name (rig_camera_names), it chooses that camera.
  std::filesystem::path calibration;
  std::string camera_id;  ///< which of several cameras in the file (imaging::camera_ids); empty: the only one
  std::string name{};     ///< which camera of a rig (rig_camera_names); empty: the first
};

/// Reads and checks a dataset folder: every frame's image exists, every line is well-formed, times strictly increase,
/// and the calibration matches the image size (of the first image). The layout is detected from the content:
///   images/                 our own and DSO's: times.txt, camera.yaml or camera.txt; without times.txt frames
///                           are 1/30 s apart (warned);
///   rgb.csv                 VSLAM-LAB: calibration.yaml, groundtruth.csv, imu_0.csv;
///   image_l/ or image_0/    KITTI odometry: calib.txt (P0), times.txt of bare seconds, poses.txt;
///   mav0/cam0/ or cam0/     EuRoC (ASL): data.csv, sensor.yaml, data/;
///   rgb.txt                 TUM RGB-D, and VSLAM-LAB before 2025-09: depth.txt, groundtruth.txt; without
///                           calibration.yaml that of freiburg1, 2 or 3 by the folder's name.
/// If the dataset is of a rig, the first camera is read, or the chosen one (rig.h reads all).
/// Frames that a list names but that have no file are left out (warned).
/// With a `camera` the layout's own calibration may be missing; the given one is scaled to images of the same aspect
/// ratio (warned), and if it has no IMU extrinsics, the layout's T_cam_imu is kept. Throws InputError (file, line,
/// cause).
Dataset read_dataset(const std::filesystem::path& folder, const CameraChoice& camera = {});

/// Returns whether the folder is a dataset in another program's layout: any that read_dataset() knows except images/.
bool has_foreign_layout(const std::filesystem::path& folder);

/// Read and write gps.csv. Throw InputError (file, line, cause).
std::vector<GpsFix> read_gps_csv(const std::filesystem::path& file);
void write_gps_csv(const std::filesystem::path& file, const std::vector<GpsFix>& fixes);

/// Writes a dataset folder frame by frame (in any order and from several threads; the files are identical). The folder
/// is built under a temporary name beside `folder` and renamed by finish(); without finish() the destructor removes it.
/// An existing `folder` is an InputError in the constructor unless it may be replaced (core/base/output_folder.h).
class DatasetWriter {
 public:
  struct Options {
    bool replace = false;
    std::string command = "tileflight";           ///< the writing command, for the folder's marker
    std::vector<std::filesystem::path> inputs{};  ///< files that the command reads; none is ever replaced
    bool png = false;                             ///< images as PNG instead of JPEG
    int jpeg_quality = 95;
    /// If given, the dataset is built here (same file system; created if missing) and kept if finish() is not called:
    /// for several processes that write together or one after the other. Only one of them calls finish().
    std::filesystem::path build_folder{};
    /// The dataset is one camera's part of a larger one: it is built in `build_folder`, where finish() leaves it.
    bool is_part = false;
  };
  DatasetWriter(std::filesystem::path folder, imaging::Calibration calibration, Options options);
  ~DatasetWriter();
  DatasetWriter(const DatasetWriter&) = delete;
  DatasetWriter& operator=(const DatasetWriter&) = delete;

  /// Folder of this dataset's files before finish(); for additional files such as pcalib.txt and depth/
  /// (frame_layers.h).
  const std::filesystem::path& temporary_folder() const { return temporary_; }

  void add_frame(std::size_t index, double time_s, double exposure_ms, const imaging::RgbImage& image);
  /// Adds a frame by copying its encoded file; `extension` is ".jpg" or ".png".
  void add_encoded_frame(std::size_t index, double time_s, double exposure_ms, std::span<const std::byte> bytes,
                         const std::string& extension);
  /// Adds a frame whose file another writer has already written into the same Options::build_folder.
  void add_existing_frame(std::size_t index, double time_s, double exposure_ms);
  void set_groundtruth(geometry::Trajectory trajectory);
  void set_gps(std::vector<GpsFix> fixes);
  /// Sets a key of dataset.yaml; "a.b.c" nests. A repeated key replaces its value.
  void describe(const std::string& key, const std::string& value);
  /// Writes the lists and moves the folder to its final name. Throws InputError: no frames, times that do not increase
  /// with the index, file system errors (the temporary folder is then removed too).
  void finish();

 private:
  struct Impl;
  std::filesystem::path temporary_;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tileflight::dataset
