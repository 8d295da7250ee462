#pragma once

#include <cstddef>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "tileflight/geometry/geodesy.h"
#include "tileflight/geometry/output_folder.h"
#include "tileflight/geometry/trajectory.h"
#include "tileflight/imaging/camera.h"
#include "tileflight/imaging/image.h"

namespace tileflight::dataset {

struct Frame {
  std::string id;  ///< "000000"
  std::filesystem::path image;
  double time_s = 0.0;
  double exposure_ms = 0.0;  ///< 0: unknown
};

/// A line of gps.csv: t,lat,lon,height,horizontal_sigma,vertical_sigma.
struct GpsFix {
  double time_s = 0.0;
  geometry::Geodetic place;
  double horizontal_sigma_m = 0.0;
  double vertical_sigma_m = 0.0;
};

/// A sensor dataset on disk (contract: "A dataset folder"). Images stay on disk; frames are in time order.
struct Dataset {
  std::filesystem::path folder;
  std::vector<Frame> frames;
  imaging::Calibration calibration;
  std::filesystem::path pcalib;    ///< empty where there is none
  std::filesystem::path vignette;  ///< empty where there is none
  std::optional<geometry::Trajectory> groundtruth;
  std::vector<GpsFix> gps;
  std::map<std::string, std::string> about;  ///< dataset.yaml, flattened "a.b" -> text
  std::vector<std::string> warnings;  ///< what was put up with, one line each (no times.txt, images left out, ...)
};

/// A calibration in place of the one that a dataset's layout has.
struct CameraChoice {
  std::filesystem::path calibration;  ///< of any form that imaging::read_calibration knows; empty: the dataset's own
  std::string camera_id;  ///< which of several cameras in the file (imaging::camera_ids); empty: the only one
};

/// Reads and checks a dataset folder: every frame's image is there and every line well-formed, times strictly increase,
/// the calibration is for the images' size (the first image is looked at). Layouts, told apart by what is there:
///   images/   the contract's and DSO's: times.txt, camera.yaml or camera.txt; without times.txt frames are 1/30 s
///   apart (warned); image_l/ or image_0/   KITTI odometry: calib.txt (P0), times.txt of bare seconds, poses.txt;
///   mav0/cam0/ or cam0/    EuRoC (ASL): data.csv, sensor.yaml, data/; frames without a file are left out (warned).
/// With a `camera` the layout's own calibration need not be there; it is scaled to images of its shape (warned), and
/// where it says nothing of the IMU, the layout's T_cam_imu stays. Throws InputError (file, line, cause).
Dataset read_dataset(const std::filesystem::path& folder, const CameraChoice& camera = {});

std::vector<GpsFix> read_gps_csv(const std::filesystem::path& file);
void write_gps_csv(const std::filesystem::path& file, const std::vector<GpsFix>& fixes);

/// What dataset folders hold that were written before folders had a marker.
geometry::UnmarkedFolder unmarked_dataset();

/// Writes a dataset folder frame by frame (frames may come in any order and from several threads; the files are the
/// same). Nothing is at `folder` until finish(): it is built beside and renamed; destroyed without finish(), it is
/// removed. An existing `folder` is an InputError at once unless it may be replaced (geometry/output_folder.h).
class DatasetWriter {
 public:
  struct Options {
    bool replace = false;
    std::string command = "tileflight";           ///< that writes it ("render"), for the folder's marker
    std::vector<std::filesystem::path> inputs{};  ///< that the command reads; none is ever replaced
    bool png = false;                             ///< images as PNG instead of JPEG
    int jpeg_quality = 95;
    /// Built here instead (on the same file system; made where it is not there), and left there without finish(): what
    /// several processes write together, or one after the other. Only one of them calls finish().
    std::filesystem::path build_in{};
  };
  DatasetWriter(std::filesystem::path folder, imaging::Calibration calibration, Options options);
  ~DatasetWriter();
  DatasetWriter(const DatasetWriter&) = delete;
  DatasetWriter& operator=(const DatasetWriter&) = delete;

  /// Where files of this dataset go before finish(); for extras such as pcalib.txt and depth/ (frame_layers.h).
  const std::filesystem::path& temporary_folder() const { return temporary_; }

  void add_frame(std::size_t index, double time_s, double exposure_ms, const imaging::RgbImage& image);
  /// A frame whose file is copied as it is; `extension` is ".jpg" or ".png".
  void add_encoded_frame(std::size_t index, double time_s, double exposure_ms, std::span<const std::byte> bytes,
                         const std::string& extension);
  /// A frame whose file is there already, written into the same Options::build_in by another writer.
  void add_written_frame(std::size_t index, double time_s, double exposure_ms);
  void set_groundtruth(geometry::Trajectory trajectory);
  void set_gps(std::vector<GpsFix> fixes);
  /// A line of dataset.yaml, "a.b.c" nests. The same key again replaces its value.
  void describe(const std::string& key, const std::string& value);
  /// Writes the lists and puts the folder in its place. Throws InputError: no frames, times that do not increase with
  /// the index, or what the file system says (nothing is left behind then either).
  void finish();

 private:
  struct Impl;
  std::filesystem::path temporary_;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tileflight::dataset
