#pragma once

#include <filesystem>
#include <string>
#include <vector>

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

/// Where DSEC's rectify_map takes an event camera's pixels: to a pinhole camera of the same size, whose focal length is
/// that of the lens's middle, turned by `R_rectified_camera`. One (x, y) a pixel; NaN for rays that no pinhole sees.
imaging::Image<std::array<float, 2>> rectify_map(const imaging::Camera& camera, const imaging::Camera& rectified,
                                                 const geometry::Mat3& R_rectified_camera);

/// The pinhole camera of a rectified pair, or of one: the lens's focal lengths in the middle of the image.
imaging::Camera rectified_camera(const imaging::Camera& left);

/// Rotations of a rectified pair, rectified frame from camera: x along the baseline, z as near to the mean of both
/// optical axes as that allows.
std::array<geometry::Mat3, 2> rectifying_rotations(const geometry::SE3& T_left_right);

}  // namespace tileflight::events
