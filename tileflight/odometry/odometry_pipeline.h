#pragma once

// Incremental odometry, fed one image at a time: initialization, then tracking with keyframes until tracking is lost.

#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/initialization/initializer.h"
#include "tileflight/loops/loop_closure.h"
#include "tileflight/mapping/mapper.h"
#include "tileflight/odometry/odometry.h"
#include "tileflight/photometry/options.h"
#include "tileflight/tracking/tracker.h"

namespace tileflight::odometry {

class OdometryPipeline {
 public:
  OdometryPipeline(const imaging::Calibration& calibration, const imaging::PhotometricCalibration* photometric,
                   const photometry::OdometryOptions& options, const Priors& aids = {}, KeyframeObserver observer = {});
  OdometryPipeline(const OdometryPipeline&) = delete;
  OdometryPipeline& operator=(const OdometryPipeline&) = delete;

  /// Processes the next image. Throws InputError if its size differs from the calibration's.
  void add(InputFrame frame);
  bool lost() const { return lost_; }
  /// Time of the last image used by initialization; nullopt before the map is initialized.
  std::optional<double> initialization_end_s() const { return initialization_end_s_; }
  /// Short status text for progress reports.
  std::string progress_text() const;
  /// The result so far.
  OdometryResult result() const;

 private:
  /// An image with its pose relative to the keyframe it was tracked to.
  struct TrackedFrame {
    std::int64_t index = 0;
    double time_s = 0.0;
    int keyframe = 0;
    geometry::SE3 T_camera_keyframe;
    tracking::ImageAlignment
        alignment;  ///< alignment to `keyframe`; for a keyframe, alignment to the previous keyframe
  };
  /// The keyframe to which new images are aligned.
  struct ReferenceKeyframe {
    int keyframe = 0;
    geometry::SE3 T_camera_map;
    photometry::AffineBrightness brightness;
    tracking::TrackingReference pixels;
    double first_rmse = 0.0;  ///< of the first image aligned to it; 0: none yet
  };

  std::shared_ptr<const photometry::Pyramid> make_pyramid(const InputFrame& frame);
  /// Rolling-shutter model of an image that follows the last tracked one.
  photometry::RollingShutter rolling_shutter_for(const InputFrame& frame) const;
  photometry::RowRectifier rectifier(const geometry::Vec6& twist, const tracking::ReferenceLevel& reference,
                                     const geometry::SE3& T_target_reference) const;
  void rectify_initialization(const initialization::InitializationResult& start);
  photometry::AffineBrightness brightness_prior(const InputFrame& frame) const;
  mapping::KeyframeCandidate make_keyframe_candidate(const InputFrame& frame,
                                                     std::shared_ptr<const photometry::Pyramid> pyramid,
                                                     const geometry::SE3& T_camera_map,
                                                     const photometry::AffineBrightness& light) const;
  ReferenceKeyframe make_reference_keyframe(int slot) const;

  void detect_valid_region(const imaging::RgbImage& picture);
  void notify_observer(const InputFrame& frame, int slot) const;
  std::optional<geometry::SE3> prior_pose(const InputFrame& frame) const;

  void wait_for_initialization(InputFrame frame);
  void initialize_map(const initialization::InitializationResult& start);
  std::vector<photometry::Keyframe> make_initial_keyframes(const initialization::InitializationResult& start,
                                                           const std::vector<std::size_t>& picks);
  void align_initialization_frames(const initialization::InitializationResult& start,
                                   const std::vector<std::size_t>& picks);
  void align_earlier_frames(std::size_t count);

  void track(const InputFrame& frame);
  tracking::ImageAlignment best_alignment(const photometry::Pyramid& pyramid,
                                          const photometry::RollingShutter& shutter) const;
  std::optional<tracking::ImageAlignment> recover(const photometry::Pyramid& pyramid);
  void on_failure(const InputFrame& frame, const tracking::ImageAlignment& alignment);
  void record(const InputFrame& frame, const ReferenceKeyframe& reference, const geometry::SE3& T_camera_reference,
              tracking::ImageAlignment alignment);
  std::vector<tracking::FrameQuality> quality() const;
  void store_loop_features(int slot);
  std::map<int, double> close_loops(std::vector<mapping::KeyframeRecord>& keyframes,
                                    std::vector<mapping::MapPoint>& points, OdometryResult& result) const;
  void make_keyframe(const InputFrame& frame, std::shared_ptr<const photometry::Pyramid> pyramid,
                     const geometry::SE3& T_camera_map, const photometry::AffineBrightness& light,
                     const tracking::ImageAlignment& alignment);

  imaging::Calibration calibration_;
  const imaging::PhotometricCalibration* photometric_;
  photometry::PyramidPool pyramids_;
  photometry::OdometryOptions options_;
  Priors priors_;
  KeyframeObserver observer_;
  photometry::LensPyramid lens_;
  bool valid_region_found_ = false;  ///< the valid region was found on an image that is not dark
  std::optional<double> initialization_end_s_;
  initialization::Initializer initializer_;
  mapping::Mapper mapper_;

  std::deque<InputFrame> buffered_frames_;  ///< images received before initialization
  std::size_t first_buffered_ = 0;          ///< sequence number of the first of them
  bool initialized_ = false;
  bool lost_ = false;
  std::string lost_reason_;
  std::int64_t frame_count_ = 0;
  std::vector<std::pair<std::int64_t, double>> frame_stamps_;  ///< index and time of each image

  ReferenceKeyframe reference_;
  geometry::SE3 T_last_map_;  ///< pose of the last tracked image
  geometry::SE3 T_last_before_last_;
  double last_time_s_ = 0.0;            ///< of the last tracked image
  double last_interval_s_ = 0.0;        ///< between the last two tracked images; 0: unknown
  double last_a_ = 0.0, last_b_ = 0.0;  ///< brightness of the last image relative to the reference
  double last_rmse_ = 0.0;
  int consecutive_failures_ = 0;
  std::vector<TrackedFrame> tracked_frames_;
  std::vector<ReferenceKeyframe>
      recovery_references_;  ///< the window's keyframes as references, filled while alignment fails
  std::int64_t relocalizations_ = 0;
  std::vector<loops::LoopKeyframe> loop_keyframes_;  ///< all keyframes in order of id; filled for loop closure only
  StageTimes cpu_time_;
};

}  // namespace tileflight::odometry
