#pragma once

// Inputs of the odometry from a dataset: images of one camera, its calibration, masks and priors, and depending on the
// mode the inertial unit and the rig's other cameras.

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/core/imaging/photometric.h"
#include "tileflight/core/imaging/rectify.h"
#include "tileflight/data/dataset/dataset.h"
#include "tileflight/slam/inertial/align_to_gravity.h"
#include "tileflight/slam/odometry/odometry.h"
#include "tileflight/slam/odometry/track.h"

namespace tileflight::odometry {

/// Reads an inertial unit's readings (imu.csv), noise (imu.yaml; without it EuRoC's ADIS16448, with a line in
/// `warnings`) and mounting (T_cam_imu). The readings are checked (slam/inertial/imu_check.h). Throws InputError for a
/// dataset without an inertial unit, and for readings that cannot be used.
inertial::InertialInput read_inertial_input(const dataset::Dataset& data, double gravity_m_s2,
                                            std::vector<std::string>& warnings);

/// A rig's reference camera, and the others that expose at the same instants.
struct StereoRig {
  dataset::Dataset reference;
  std::vector<odometry::OtherCamera> others;
  std::map<double, std::vector<std::optional<dataset::Frame>>> other_frames;  ///< by the time of a reference frame: of
                                                                              ///< each of `others`, if it took one
};

/// Pictures whose times differ by at most this are of one instant.
inline constexpr double kSameInstant_s = 1e-4;

/// Reads a dataset with several cameras. The reference camera is the first, or the one that `camera` names. Cameras
/// without a picture at an instant of the reference camera are left out, with a line in `warnings`. Throws InputError
/// for a dataset with one camera, if `camera` is no name, and if no other camera is left.
StereoRig read_stereo_rig(const std::filesystem::path& folder, const std::string& camera,
                          std::vector<std::string>& warnings);

/// Camera of the images as they are tracked: unchanged, or rectified.
struct TrackingCamera {
  imaging::Camera native;
  imaging::Calibration calibration;  ///< of the images as tracked
  std::optional<imaging::Rectifier> rectifier;
};
/// `rectify_fov_deg`: horizontal field of view of the pinhole to which images are rectified; none: they are unchanged.
TrackingCamera make_tracking_camera(const imaging::Calibration& calibration, std::optional<double> rectify_fov_deg);

/// Returns the frames of the range. In reverse order, times are relative to the last frame, because odometry needs
/// increasing times. Throws InputError if there are none.
std::vector<dataset::Frame> select_frames(const dataset::Dataset& data, const FrameRange& range);

/// Images that could not be decoded.
struct SkippedImages {
  std::int64_t frames = 0;
  std::string first_reason;
};

struct SkippedFrames : SkippedImages {
  SkippedImages of_others;  ///< of a rig's other cameras
  SkippedImages repeated;   ///< not left out, but equal to the image before; first_reason: the first one's id
};

/// Reads the chosen images one by one, each while the one before it is tracked. Times are negated in reverse order;
/// reverse_times() restores them. `rig`: whose other cameras' images are read, too; null: none. All arguments must
/// outlive the source, which throws InputError for an image of another size than the calibration's.
odometry::FrameSource make_frame_source(const std::vector<dataset::Frame>& frames, bool reverse,
                                        const TrackingCamera& view, const StereoRig* rig, SkippedFrames& skipped);

/// Puts the poses into the opposite order, at negated times.
void reverse_times(geometry::Trajectory& trajectory);

/// Reads the dataset's response and vignetting, for the images as tracked; none if it has no such files.
std::optional<imaging::PhotometricCalibration> read_photometric_calibration(const dataset::Dataset& data,
                                                                            const TrackingCamera& view);

/// Reads the mask, and the poses or depth to initialize from, that the options name, into `input`, whose depth_m refers
/// to `frames` and `view`. Throws InputError for files that cannot be read, and for images of another size than the
/// calibration's.
void read_mask_and_priors(const TrackOptions& extras, const std::vector<dataset::Frame>& frames, bool reverse,
                          const TrackingCamera& view, OdometryInput& input);

}  // namespace tileflight::odometry
