#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "tileflight/capture/events/event_pixels.h"
#include "tileflight/core/base/progress.h"
#include "tileflight/core/imaging/camera.h"
#include "tileflight/data/dataset/rig.h"
#include "tileflight/data/exports/export_dataset.h"

namespace tileflight::events {

/// Writes the first two event cameras of a dataset as a sequence of DSEC's (dsec_file.h), atomically:
///   events/left, events/right    events.h5, as it is, and rectify_map.h5 (rectify_map)
///   images/left/distorted, …     their pictures, PNG, with the lens of the events
///   images/timestamps.txt        of the left camera's pictures, microseconds on the clock of t_offset
///   calibration/left.yaml, …     lenses, as Kalibr has them
/// Notes tell what the layout does not hold. Throws InputError: no camera has events, and as exports::export_rig.
exports::ExportResult export_dsec(const dataset::Rig& rig, const std::filesystem::path& folder, bool replace,
                                  const Progress& progress = {}, std::vector<std::filesystem::path> inputs = {});

/// Computes DSEC's rectify_map: for each pixel of an event camera, its position (x, y) in the image of a pinhole camera
/// of the same size, whose focal length is that of the lens's middle, turned by `R_rectified_camera`. NaN for rays that
/// no pinhole sees.
imaging::Image<std::array<float, 2>> rectify_map(const imaging::Camera& camera, const imaging::Camera& rectified,
                                                 const geometry::Mat3& R_rectified_camera);

/// Returns the pinhole camera of rectified images, whose focal lengths are the left lens's in the middle of its image.
imaging::Camera rectified_camera(const imaging::Camera& left);

/// Returns the rotations of a rectified pair, R_rectified_camera of the left and the right camera: x is along the
/// baseline, z as near to the mean of both optical axes as that allows.
std::array<geometry::Mat3, 2> rectifying_rotations(const geometry::SE3& T_left_right);

/// Writes events.h5 in the layout of DSEC (Gehrig, Aarents, Gehrig, Scaramuzza, "DSEC: a stereo event camera dataset
/// for driving scenarios", IEEE Robotics and Automation Letters 6(3), 2021), which its tools read:
///   events/x, events/y   uint16: column and row
///   events/t             uint32: microseconds since t_offset, ascending
///   events/p             uint8: 1 brighter, 0 darker
///   ms_to_idx            uint64: of each millisecond k, the number of events with t < 1000 k
///   t_offset             int64: microseconds on the dataset's clock
/// Compressed by HDF5's own filters (shuffle, deflate), which every reader has; DSEC's files need the plugin blosc. The
/// bytes depend on the events alone. Events are written in blocks as they come. Throws InputError (file, cause).
class DsecWriter {
 public:
  explicit DsecWriter(std::filesystem::path file);
  ~DsecWriter();
  DsecWriter(const DsecWriter&) = delete;
  DsecWriter& operator=(const DsecWriter&) = delete;

  /// Adds events, which follow those before in time.
  void add(std::span<const Event> events);
  /// Completes the file. `t_offset_us`: of t = 0 on the dataset's clock; `end_us`: of the recording, for ms_to_idx.
  void finish(std::int64_t t_offset_us, std::uint32_t end_us);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// The content of an events.h5.
struct EventRecording {
  std::vector<Event> events;
  std::vector<std::uint64_t> ms_to_idx;
  std::int64_t t_offset_us = 0;
};

/// Reads a file of DsecWriter, or another in this layout whose filters the HDF5 library has. Throws InputError (file,
/// cause) for one that is unreadable or has another layout, and for more than `most_events`.
EventRecording read_dsec_file(const std::filesystem::path& file, std::uint64_t most_events = std::uint64_t{1} << 28);

}  // namespace tileflight::events
