#pragma once

// Direct Sparse Odometry: Engel, Koltun, Cremers, IEEE TPAMI 40(3), 2018. Odometry takes one image at a time; a whole
// sequence goes through run_odometry(), which is a loop over it.

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "tileflight/core/base/progress.h"
#include "tileflight/core/geometry/point_cloud.h"
#include "tileflight/core/geometry/trajectory.h"
#include "tileflight/core/imaging/camera.h"
#include "tileflight/core/imaging/image.h"
#include "tileflight/core/imaging/photometric.h"
#include "tileflight/slam/inertial/align_to_gravity.h"
#include "tileflight/slam/keyframes/options.h"
#include "tileflight/slam/mapping/line_delay_estimate.h"
#include "tileflight/slam/mapping/systematic_displacement.h"
#include "tileflight/slam/tracking/frame_quality.h"

namespace tileflight::odometry {

class OdometryPipeline;

// Types of other rooms that appear in this interface.
using keyframes::MapOptions;
using keyframes::OdometryOptions;
using tracking::FrameQuality;

/// A picture of another camera of the rig.
struct OtherImage {
  imaging::RgbImage image;   ///< empty: the camera took none
  double exposure_ms = 0.0;  ///< 0: unknown
};

/// One input image of the odometry. It carries no ground truth.
struct InputFrame {
  std::int64_t index = 0;    ///< frame index in the dataset; increases from image to image
  double time_s = 0.0;       ///< increases from image to image
  double exposure_ms = 0.0;  ///< 0: unknown
  imaging::RgbImage image;   ///< colour is used for map points only; tracking uses luma
  std::vector<OtherImage> others =
      {};  ///< at the same instant, by OdometryInput::other_cameras; those left out took none
};

/// Another camera on the same body, exposed at the same instants as the reference camera, whose images the frames are.
struct OtherCamera {
  std::string name;  ///< for messages
  imaging::Calibration calibration;
  std::optional<imaging::PhotometricCalibration> photometric;
  geometry::SE3 T_other_reference;  ///< metres; taken as exact, like the calibrations of a rig
};

/// Supplies the images in order; returns nullopt after the last one. Called from one thread.
using FrameSource = std::function<std::optional<InputFrame>()>;

/// Processor time of all threads by stage, seconds. Reading the images is not included.
struct StageTimes {
  double initialization = 0.0;  ///< everything up to the first map, and tracking backwards from it
  double preprocessing = 0.0;   ///< luma and pyramids, after initialization
  double tracking = 0.0;        ///< alignment to the keyframe
  double tracing = 0.0;         ///< depth search for immature points
  double keyframes = 0.0;       ///< selection, activation, window optimisation, marginalisation
  double loops = 0.0;           ///< keyframe features, loop detection and closure
  double focal_changes = 0.0;   ///< the check whether the focal length changes

  double total() const {
    return initialization + preprocessing + tracking + tracing + keyframes + loops + focal_changes;
  }
};

/// A keyframe with its points, for a debug image.
struct KeyframeView {
  struct Point {
    float x = 0, y = 0;  ///< pixels
    float inverse_distance = 0;
  };
  std::int64_t index = 0;  ///< frame index
  const imaging::RgbImage& image;
  std::vector<Point> points;
};

/// Callback for each keyframe. Called from the odometry's thread.
using KeyframeObserver = std::function<void(const KeyframeView&)>;

/// Everything that an odometry is given besides its settings and its images. Only the calibration is required:
///
///     OdometryInput input = calibration;
///     input.mask = imaging::read_gray("mask.png");
struct OdometryInput {
  OdometryInput(imaging::Calibration reference) : calibration(std::move(reference)) {}  // NOLINT: the rest is optional

  imaging::Calibration calibration;                            ///< of the camera that takes the images
  std::optional<imaging::PhotometricCalibration> photometric;  ///< response and vignetting; none: the images are taken
                                                               ///< as linear, without vignetting
  imaging::GrayImage mask;     ///< same size as the images; pixels below 128 are ignored (vehicle body, mount); empty:
                               ///< no mask
  geometry::Trajectory poses;  ///< prior T_world_camera at the images' times: initialization takes its motion from
                               ///< them, and map and trajectory are given in their frame and scale
  std::function<std::optional<imaging::FloatImage>(std::int64_t index)>
      depth_m;  ///< prior depth image of frame `index`, metres along the optical axis, not finite or 0 where unknown;
                ///< sets the scale
  std::optional<inertial::InertialInput> inertial;  ///< readings on the images' clock, or nearly: map and trajectory
                                                    ///< are given in metres and level, if the readings show the scale;
                                                    ///< not together with poses or depth
  std::vector<OtherCamera> other_cameras;  ///< at most 4; static stereo with them makes map and trajectory metric from
                                           ///< the first image on. The calibrations are held, as that of one rig. Not
                                           ///< together with prior poses or depth, nor with rolling shutters
  KeyframeObserver keyframe_observer;
};

/// Two keyframes recognized as showing the same place (options.loops).
struct LoopClosure {
  std::int64_t from_frame = 0;  ///< the earlier keyframe's InputFrame::index
  std::int64_t to_frame = 0;
  double scale_change = 1.0;  ///< length at `to_frame` over the same length at `from_frame`, before loop closure
  int inliers = 0;            ///< feature matches consistent with the loop
};

/// Focal lengths over one segment of the flight.
struct FocalSegment {
  /// An image of the segment, with its focal length relative to that of the segment's first image.
  struct Image {
    std::int64_t frame = 0;  ///< InputFrame::index
    double time_s = 0.0;
    double log_change = 0.0;  ///< natural logarithm of the ratio; 0 for the first image
    double sigma = 0.0;       ///< standard deviation of `log_change`, if the errors of all pixels are independent
  };
  std::vector<Image> images;         ///< the first image and a few of the others, in order of time
  double one_focal_length_px = 0.0;  ///< median residual with one focal length
  double residual_px = 0.0;          ///< median residual with a focal length for each image

  /// Returns the image whose focal length differs most from the first one's.
  const Image& most_changed() const;
  /// Returns whether the focal length changes beyond doubt: the images fit much better if it may, and the change is
  /// large. A constant rate of change over the whole segment often fits as well with one focal length and another
  /// motion; then its beginning or end shows it.
  bool shows_change() const;
};

/// Agreement of corners, seen by two cameras of a rig at one instant, with its calibration.
struct RigFit {
  int matches = 0;            ///< corners that fit
  double rotation_rad = 0.0;  ///< by which the other camera would have to be turned; 0: by nothing that its images show
  double behind_share = 0.0;  ///< of the corners with parallax: how many would be behind the cameras
};

/// States how a rig's camera is turned against its calibration, by corners whose distances the motion shows.
struct RigTurn {
  int segments = 0;                                  ///< of the flight, each with its own scale
  geometry::Vec3 turn_rad = geometry::Vec3::Zero();  ///< of the camera's rays, in the reference camera's axes
  geometry::Mat3 covariance_rad2 = geometry::Mat3::Zero();
  geometry::Vec3 parallax_axis = geometry::Vec3::UnitY();  ///< a turn about it moves corners as another distance does
  double parallax_rad = 0.0;  ///< median of the angles by which the rig's baseline moves the corners
  double pixel_rad = 0.0;     ///< angle of a pixel of the reference camera

  double along_parallax_rad() const { return turn_rad.dot(parallax_axis); }
  double along_parallax_sigma_rad() const;
  /// Share by which the rig makes distances of the median too large; below 0: too small.
  double distance_error() const { return along_parallax_rad() / parallax_rad; }
};

/// Statistics of the images of another camera of the rig.
struct OtherCameraResult {
  std::string name;
  std::int64_t frames = 0;             ///< with a picture of it
  std::int64_t frames_blind = 0;       ///< of those: the picture shows nothing
  int keyframes = 0;                   ///< with a picture that shows something
  int keyframes_unmatched = 0;         ///< of those: nothing in it matches the reference camera's picture
  double matched_share = 0.0;          ///< of the points that were searched for in its pictures; 0: none
  std::int64_t last_frame = -1;        ///< InputFrame::index of the last with a picture of it; -1: none
  std::int64_t frames_after_last = 0;  ///< all frames after that one
  std::optional<RigFit> fit;  ///< the one with the median rotation of up to three instants; none if too few corners are
                              ///< seen by both cameras
  std::optional<RigTurn> turn;  ///< none where no segment of the flight shows distances by motion
};

/// Result of static stereo.
struct StereoResult {
  bool metric = false;  ///< map and trajectory are in metres; else they are those of the reference camera alone
  std::vector<OtherCameraResult> cameras;  ///< by OdometryInput::other_cameras
};

struct OdometryResult {
  geometry::Trajectory trajectory;  ///< T_map_camera of every tracked frame; without priors the scale is arbitrary
                                    ///< (monocular)
  geometry::Trajectory keyframes;
  geometry::PointCloud map;  ///< frame `map`; scalars: inverse_depth_variance, observations, first_frame, last_frame
  std::vector<std::int64_t> keyframe_frame_indices;  ///< InputFrame::index of each of `keyframes`
  std::vector<std::vector<int>>
      map_point_keyframes;                ///< for each point of `map`: indices into `keyframes` of its host (first) and
                                          ///< of the others with a good residual when it left the window
  std::optional<imaging::Camera> camera;  ///< the given camera with refined intrinsics, if estimated; none if
                                          ///< initialization failed
  std::int64_t frames = 0;                ///< read
  std::int64_t frames_tracked = 0;
  std::int64_t frames_before_start = 0;       ///< of `frames`: before the first keyframe of the first map
  std::int64_t frames_tracked_backwards = 0;  ///< of those: with a pose, by tracking backwards from the first map
  std::vector<FrameQuality> quality;          ///< of every image read, in order
  std::optional<mapping::SystematicDisplacement>
      systematic_displacement;               ///< from the residuals of all keyframes; none if there are too few
  std::vector<FocalSegment> focal_segments;  ///< focal lengths over short segments, in order of time
  std::optional<mapping::LineDelayEstimate> line_delay;  ///< with OdometryOptions::estimate_line_delay, unless there
                                                         ///< are too few keyframes
  std::vector<LoopClosure> loops;                        ///< loops that were found and measured
  bool loops_closed = false;  ///< they corrected poses and map; false: none contradicts the path
  std::optional<inertial::InertialAlignment> inertial;  ///< with OdometryInput::inertial and a map; without `metric`
                                                        ///< map and trajectory are as without readings
  std::optional<double> coupled_since_s;  ///< time of the keyframe from which on the readings were part of the window;
                                          ///< none: they never were
  std::optional<StereoResult> stereo;     ///< with OdometryInput::other_cameras
  std::int64_t relocalizations = 0;       ///< how often tracking failed and was recovered on an older keyframe
  bool lost = false;                      ///< tracking ended before the last image, or never started
  std::string lost_reason;                ///< if lost: the frame and the reason
  std::string lost_remedy;                ///< what to do about it; empty: nothing particular is known
  std::string lost_detail;                ///< measures of the last image that did not align, in parentheses
  std::optional<std::int64_t>
      lost_since;            ///< InputFrame::index of the first image that did not align, if there is a map
  bool backwards = false;    ///< the images were tracked from the last to the first; everything here is
                             ///< in the order of the flight all the same (track())
  double wall_time_s = 0.0;  ///< wall time of the run, image decoding included
  StageTimes cpu_time;
};

/// Status of an image after it was added.
enum class FrameStatus {
  kInitializing,  ///< no map yet: the image is kept until there is enough parallax
  kTracked,       ///< the image has a pose
  kNotAligned,    ///< the image has no pose; the next one may have
  kLost           ///< too many images in a row did not align; all later ones are ignored
};

/// Estimate for an image at the moment when it was added.
struct FrameResult {
  FrameStatus status = FrameStatus::kInitializing;
  std::optional<geometry::SE3> T_map_camera;  ///< if tracked; without its scale (monocular), see T_world_map()
  FrameQuality quality;                       ///< with standard deviations, in map units, if tracked
  std::string reason;                         ///< why there is no pose; empty if tracked
};

/// Incremental odometry: images in, one at a time; the pose of each comes out at once, trajectory and map at the end.
///
///     Odometry odometry(calibration, options);
///     while (...) {
///       const FrameResult frame = odometry.add(image, time_s);
///       if (frame.T_map_camera) use(*frame.T_map_camera);
///     }
///     const OdometryResult result = odometry.finish();
///
/// add() returns the estimate of that moment. finish() knows more:
/// - Images before the map (kInitializing) get their poses when initialization succeeds: those of its window, and those
///   before it by tracking backwards from the first keyframe, with keyframes of their own where the first map does not
///   reach. trajectory() has them from then on. They are kept until then, OdometryOptions::initialization.buffer_mb
///   megabytes of them (or those of one attempt, if these are more); the call that makes the map tracks them all, and
///   takes as much longer. Images that were dropped, or that do not align, stay without a pose.
/// - Poses are relative to keyframes. A keyframe's pose and its points are optimised further until it leaves the
///   window, after some five to seven keyframes, and its images move along.
/// - Loop closure (OdometryOptions::loops) runs once, in finish(), over all keyframes. It never changes tracking.
/// - Frame and scale of the priors are applied in finish(); T_world_map() gives them before.
/// - Readings of an inertial unit (OdometryInput::inertial) are used in finish(), over all keyframes. Before, they only
/// help
///   where an image does not align; with OdometryOptions::inertial_in_window they are part of the window. Before the
///   map, initialization begins anew with a later image whenever its corners are lost; after it
/// there is no restart: a lost odometry stays lost and keeps its map. Tracking the whole sequence backwards, too, and
/// choosing between both directions is not done here but by the `odometry` command, with a second odometry
/// (tracking_warnings.h).
///
/// One thread at a time may use an object; it computes on all threads of TBB. The result does not depend on their
/// number. An InputError of add() leaves the odometry as it was, so that the next image may be added. A moved-from
/// odometry is like one after finish().
class Odometry {
 public:
  /// Throws InputError if the calibration has no image size, and for other cameras that cannot be used.
  explicit Odometry(OdometryInput input, const OdometryOptions& options = {});
  Odometry(Odometry&&) noexcept;
  Odometry& operator=(Odometry&&) noexcept;
  ~Odometry();

  /// Processes the next image. `T_world_camera`: its prior pose, if it is known (a fused navigation solution, for
  /// example); the same as an entry of OdometryInput::poses, which must then be empty. Poses after initialization have
  /// no effect. Throws InputError if the image's size differs from the calibration's or the mask's, if time or index do
  /// not increase or are not finite, if a prior pose is not finite or given in both ways, and after finish().
  FrameResult add(InputFrame frame, const std::optional<geometry::SE3>& T_world_camera = {});
  /// Processes the next image, one without exposure time, whose index is the number of images before it.
  FrameResult add(imaging::RgbImage image, double time_s, const std::optional<geometry::SE3>& T_world_camera = {});

  /// Returns whether tracking is lost, so that later images are ignored.
  bool lost() const;
  /// Returns the number of images processed, ignored ones not counted.
  std::int64_t frames() const;
  /// Returns a few words on the present state, for progress reports.
  std::string progress_text() const;

  /// Return T_map_camera of the images with a pose, of the keyframes, and the map, as estimated now, before loop
  /// closure; empty before the map. A map point's scalar `keyframe` is an index into keyframes(). Each takes time in
  /// proportion to the flight.
  geometry::Trajectory trajectory() const;
  geometry::Trajectory keyframes() const;
  geometry::PointCloud map() const;
  /// Returns the latest keyframes, at most `count`, with what the window says of the steps between them, in map units,
  /// as inertial::align_to_gravity() takes them. Takes time in proportion to the flight.
  std::vector<inertial::VisualKeyframe> latest_keyframes(std::size_t count) const;
  /// Returns the transform from the map to the frame and scale of the priors, as estimated now; nullopt without priors
  /// or before the map. Throws InputError if the priors do not determine it, as finish() does.
  std::optional<geometry::Sim3> T_world_map() const;

  /// Ends the odometry and returns everything that it found; afterwards every call but assignment throws InputError.
  /// The result is that of run_odometry() over the same images. Throws InputError if the priors do not determine frame
  /// and scale; the odometry is not ended then.
  OdometryResult finish();

 private:
  OdometryPipeline& pipeline() const;

  std::unique_ptr<OdometryPipeline> pipeline_;  ///< null after finish()
  double begin_s_ = 0.0;                        ///< steady clock, at construction
};

/// Runs the odometry over a whole sequence: adds the images until there are no more or tracking is lost, and finishes.
/// Throws InputError as Odometry does: an image, mask or depth of another size than the calibration's, times that do
/// not increase, a calibration without an image size, prior poses that do not overlap the images in time.
OdometryResult run_odometry(OdometryInput input, const FrameSource& next_frame, const OdometryOptions& options,
                            const Progress& progress = {});

}  // namespace tileflight::odometry
