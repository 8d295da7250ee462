#pragma once

// State that tracking carries from one image to the next.

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "tileflight/slam/mapping/mapper.h"
#include "tileflight/slam/odometry/odometry.h"
#include "tileflight/slam/odometry/preprocessor.h"
#include "tileflight/slam/tracking/tracker.h"

namespace tileflight::odometry {

/// The keyframe to which new images are aligned; a copy of its state when it was made the reference.
struct ReferenceKeyframe {
  int keyframe = 0;  ///< id
  geometry::SE3 T_camera_map;
  keyframes::AffineBrightness brightness;
  tracking::TrackingReference pixels;
  double first_rmse = 0.0;  ///< of the first image aligned to it, grey values; 0: none yet
};

/// The last image with a pose. The search for the next image's pose begins here.
struct LastFrame {
  geometry::SE3 T_camera_map;
  geometry::SE3 T_last_before_last;  ///< motion since the image with a pose before; identity after failures
  double time_s = 0.0;
  double interval_s = 0.0;  ///< time of that motion; 0: unknown
  double a = 0.0, b = 0.0;  ///< brightness relative to the reference keyframe
  double rmse = 0.0;        ///< of its alignment, grey values; 0: unknown
};

/// The images since `LastFrame` that did not align; empty while tracking works.
struct Failures {
  int count = 0;
  std::int64_t first = 0;                              ///< InputFrame::index of the first one
  std::string detail;                                  ///< measures of the last one, in parentheses
  std::string reason;                                  ///< of the last one
  double motion_px = 0.0;                              ///< of features matched with the reference; 0: hardly any match
  std::vector<ReferenceKeyframe> recovery_references;  ///< the window's keyframes, newest first; empty before the first
                                                       ///< attempt to relocalize

  bool none() const { return count == 0; }
};

/// State from the first map on: tracking (no failures), recovering (some), or lost (more than
/// TrackingOptions::max_failed_frames), which is final.
struct TrackingState {
  double initialization_end_s = 0.0;  ///< time of the last image used by initialization
  ReferenceKeyframe reference;
  LastFrame last;
  Failures failures;
  bool far_apart = false;  ///< the last image was found by matched features (wide_search.h), and so the next one may be
};

/// Keyframe `slot` of the mapper's window as a reference.
ReferenceKeyframe make_reference_keyframe(const mapping::Mapper& mapper, const keyframes::LensPyramid& lens, int slot);

/// Tells how well the brightness parameters (a, b) of a new keyframe are known beforehand.
enum class BrightnessKnowledge {
  kFixed,  ///< the first keyframe: only differences are observable
  kKnown,  ///< by photometric calibration and exposure time
  kFree
};

/// The pixels of a reference in another image, with their inverse distances there.
std::vector<tracking::ReferencePoint> known_pixels(const keyframes::Lens& lens,
                                                   const tracking::ReferenceLevel& reference,
                                                   const geometry::SE3& T_target_reference);

/// The image as a keyframe for the mapper. `frame` must outlive the candidate.
mapping::KeyframeCandidate make_keyframe_candidate(const InputFrame& frame,
                                                   std::shared_ptr<const keyframes::Pyramid> pyramid,
                                                   const geometry::SE3& T_camera_map,
                                                   const keyframes::AffineBrightness& brightness,
                                                   const keyframes::AffineBrightness& brightness_prior,
                                                   BrightnessKnowledge knowledge);

/// Brightness of an image that is aligned to a reference with the parameters (a, b).
keyframes::AffineBrightness compose_brightness(const keyframes::AffineBrightness& reference, double a, double b);

}  // namespace tileflight::odometry
