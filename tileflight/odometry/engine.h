#pragma once

// The odometry as a machine that is given one picture after the other: start, then tracking with keyframes, until it is
// lost.

#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/odometry/initializer.h"
#include "tileflight/odometry/loop_closure.h"
#include "tileflight/odometry/mapper.h"
#include "tileflight/odometry/odometry.h"
#include "tileflight/odometry/options.h"
#include "tileflight/odometry/tracker.h"

namespace tileflight::odometry {

class Engine {
 public:
  Engine(const imaging::Calibration& calibration, const imaging::PhotometricCalibration* photometric,
         const OdometryOptions& options, const Aids& aids = {}, KeyframeObserver observer = {});
  Engine(const Engine&) = delete;
  Engine& operator=(const Engine&) = delete;

  /// The next picture. Throws InputError when its size is not the calibration's.
  void add(InputFrame frame);
  bool lost() const { return lost_; }
  /// Time of the last picture that the start needed; nothing before there was one.
  std::optional<double> start_time_s() const { return start_time_s_; }
  /// A few words on where it is, for progress.
  std::string state() const;
  /// What has been found so far.
  OdometryResult result() const;

 private:
  /// A picture with a pose relative to the keyframe it was tracked to.
  struct TrackedFrame {
    std::int64_t index = 0;
    double time_s = 0.0;
    int keyframe = 0;
    SE3 T_camera_keyframe;
    AlignmentResult alignment;  ///< of a picture that is no keyframe, to `keyframe`; of a keyframe, to the one before
  };
  /// The keyframe that pictures are aligned to.
  struct Reference {
    int keyframe = 0;
    SE3 T_camera_map;
    AffineLight light;
    TrackingReference pixels;
    double first_rmse = 0.0;  ///< of the first picture aligned to it; 0: none yet
  };

  std::shared_ptr<const Pyramid> pyramid_of(const InputFrame& frame);
  /// The readout of a picture that comes after the last tracked one.
  RollingShutter shutter_of(const InputFrame& frame) const;
  RowRectifier rectifier(const geometry::Vec6& twist, const ReferenceLevel& reference,
                         const SE3& T_target_reference) const;
  void rectify_start(const Start& start);
  AffineLight light_prior(const InputFrame& frame) const;
  KeyframeSource source_of(const InputFrame& frame, std::shared_ptr<const Pyramid> pyramid, const SE3& T_camera_map,
                           const AffineLight& light) const;
  Reference reference_of(int slot) const;

  void look_for_region(const imaging::RgbImage& picture);
  void show(const InputFrame& frame, int slot) const;
  std::optional<SE3> known_pose(const InputFrame& frame) const;

  void wait_for_start(InputFrame frame);
  void begin(const Start& start);
  std::vector<Keyframe> keyframes_of_start(const Start& start, const std::vector<std::size_t>& picks);
  void align_start_frames(const Start& start, const std::vector<std::size_t>& picks);
  void align_earlier_frames(std::size_t count);

  void track(const InputFrame& frame);
  AlignmentResult best_alignment(const Pyramid& pyramid, const RollingShutter& shutter) const;
  std::optional<AlignmentResult> recover(const Pyramid& pyramid);
  void on_failure(const InputFrame& frame, const AlignmentResult& alignment);
  void record(const InputFrame& frame, const Reference& reference, const SE3& T_camera_reference,
              AlignmentResult alignment);
  std::vector<FrameQuality> quality() const;
  void remember_corners(int slot);
  std::map<int, double> close_loops(std::vector<KeyframeRecord>& keyframes, std::vector<MapPoint>& points,
                                    OdometryResult& result) const;
  void make_keyframe(const InputFrame& frame, std::shared_ptr<const Pyramid> pyramid, const SE3& T_camera_map,
                     const AffineLight& light, const AlignmentResult& alignment);

  imaging::Calibration calibration_;
  const imaging::PhotometricCalibration* photometric_;
  PyramidPool pyramids_;
  OdometryOptions options_;
  Aids aids_;
  KeyframeObserver observer_;
  LensPyramid lens_;
  bool region_found_ = false;  ///< black surroundings were told from a dark picture
  std::optional<double> start_time_s_;
  Initializer initializer_;
  Mapper mapper_;

  std::deque<InputFrame> waiting_;  ///< pictures before the start
  std::size_t waiting_first_ = 0;   ///< count of the first of them
  bool started_ = false;
  bool lost_ = false;
  std::string lost_reason_;
  std::int64_t frames_ = 0;
  std::vector<std::pair<std::int64_t, double>> given_;  ///< index and time of each picture

  Reference reference_;
  SE3 T_last_map_;  ///< camera of the last tracked picture
  SE3 T_last_before_last_;
  double last_time_s_ = 0.0;            ///< of the last tracked picture
  double last_interval_s_ = 0.0;        ///< between the last two; 0: not known
  double last_a_ = 0.0, last_b_ = 0.0;  ///< light of the last picture relative to the reference
  double last_rmse_ = 0.0;
  int failures_ = 0;
  std::vector<TrackedFrame> tracked_;
  std::vector<Reference> recovery_;  ///< the window's keyframes as references, while pictures fail to align
  std::int64_t recoveries_ = 0;
  std::vector<LoopKeyframe> corners_;  ///< of all keyframes, in order of id; only for loop closure
  StageSeconds processor_time_;
};

}  // namespace tileflight::odometry
