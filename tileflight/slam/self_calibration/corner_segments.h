#pragma once

// Corners followed through segments of a flight, from keyframe to keyframe.

#include <cstddef>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "tileflight/core/geometry/transform.h"
#include "tileflight/slam/keyframes/pyramid.h"
#include "tileflight/slam/self_calibration/patch_alignment.h"

namespace tileflight::self_calibration {

/// Selects which images of a flight are used, and how many corners of them. Chosen by hand.
struct SegmentOptions {
  std::size_t segments = 8;       ///< spread over the flight
  std::size_t keyframes = 20;     ///< of a segment, at most
  std::size_t images = 300;       ///< through which a segment is followed, at most
  int corners = 600;              ///< followed at a time
  double keyframe_motion = 0.03;  ///< median motion of corners from one keyframe to the next, as a share of the width
  int width_px = 1400;            ///< images are halved until they are not wider
};

/// States where a corner is in a keyframe, and in the images next to it.
struct TrackPoint {
  geometry::Vec2 pixel;
  std::optional<geometry::Vec2> before, after;  ///< none: lost, or there is no such image
};

/// Holds a corner by keyframe of its segment.
struct SegmentTrack {
  std::vector<std::optional<TrackPoint>> points;
};

/// Holds a keyframe's time and those of the images next to it, seconds; equal where there is none.
struct SegmentKeyframe {
  double time_s = 0.0, before_s = 0.0, after_s = 0.0;
};

/// Holds keyframes of a part of the flight and corners in them.
struct Segment {
  std::vector<SegmentKeyframe> keyframes;
  std::vector<SegmentTrack> tracks;
};

/// Holds the segments of a flight. Pixels are those of images of the size `width` x `height`, which are smaller than
/// the flight's by whole powers of two.
struct FollowedFlight {
  int full_width = 0, full_height = 0;
  int width = 0, height = 0;
  int halvings = 0;
  bool has_times = true;  ///< whether the times of the images are known
  std::vector<Segment> segments;
};

/// Follows corners through one segment.
class SegmentFollower {
 public:
  /// `region`: of the images' size; corners are found where it has rays.
  SegmentFollower(const SegmentOptions& options, keyframes::RayTable region)
      : options_(options), region_(std::move(region)) {}

  /// Takes the next image. Returns false once the segment is complete; that image is not part of it.
  bool add(double time_s, const std::shared_ptr<const keyframes::Pyramid>& pyramid);
  /// Returns the segment, with the corners that were seen in three keyframes or more.
  Segment finish();

 private:
  struct Corner {
    std::vector<std::optional<TrackPoint>> points;  ///< by keyframe
    std::optional<Eigen::Vector2f> pixel;           ///< in the last image; none: lost
    std::optional<Eigen::Vector2f> before;          ///< in the image before it
    Patch patch;                                    ///< in the keyframe where it was found
    PatchWarp warp;                                 ///< of the patch in the last keyframe
  };

  void follow(const keyframes::Pyramid& pyramid);
  void note_after(double time_s);
  void align_patches(const keyframes::PyramidLevel& image);
  bool is_keyframe_due() const;
  void add_keyframe(double time_s, const keyframes::Pyramid& pyramid);
  void find_new_corners(const keyframes::Pyramid& pyramid);
  std::size_t alive() const;

  SegmentOptions options_;
  keyframes::RayTable region_;
  std::shared_ptr<const keyframes::Pyramid> previous_;
  double previous_s_ = 0.0;
  std::size_t images_ = 0;
  bool follows_keyframe_ = false;  ///< the next image does
  std::vector<SegmentKeyframe> keyframes_;
  std::vector<Corner> corners_;
};

}  // namespace tileflight::self_calibration
