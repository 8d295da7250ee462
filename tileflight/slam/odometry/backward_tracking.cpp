#include "tileflight/slam/odometry/backward_tracking.h"

#include <algorithm>

#include "tileflight/slam/odometry/frame_tracker.h"

namespace tileflight::odometry {
namespace {

/// The state in which the image before the first keyframe finds tracking. `after`: the image after that keyframe, whose
/// motion to it goes on; the same as `first` in a map from one instant, which knows no motion.
TrackingState state_at_first_keyframe(const mapping::Mapper& mapper, const keyframes::LensPyramid& lens,
                                      const TrackedFrame& first, const TrackedFrame& after) {
  TrackingState state;
  state.reference = make_reference_keyframe(mapper, lens, mapper.window().size() - 1);
  LastFrame& last = state.last;
  last.T_camera_map = state.reference.T_camera_map;
  last.time_s = first.time_s;
  for (const keyframes::Keyframe& keyframe : mapper.window().keyframes) {
    if (keyframe.id == after.keyframe)
      last.T_last_before_last = last.T_camera_map * (after.T_camera_keyframe * keyframe.T_camera_map()).inverse();
  }
  last.interval_s = first.time_s - after.time_s;
  if (!after.alignment.rmse.empty()) last.rmse = after.alignment.finest_rmse();
  return state;
}

/// Renumbers keyframes that were made backwards: from `next` (the first id not in the first map) on to -1, -2, ...
int earlier_id(int id, int next) { return id < next ? id : next - 1 - id; }

/// Keyframes, their steps and points of a map that grew backwards, without those of the first map.
EarlierMap earlier_map(const mapping::Mapper& mapper, int next) {
  EarlierMap earlier;
  const std::vector<mapping::KeyframeRecord> keyframes = mapper.keyframes();
  const geometry::SE3 T_first_map = keyframes.front().T_map_camera.inverse();
  for (std::size_t k = keyframes.size(); k-- > static_cast<std::size_t>(next);) {
    mapping::KeyframeRecord keyframe = keyframes[k];
    keyframe.id = earlier_id(keyframe.id, next);
    keyframe.T_map_camera = T_first_map * keyframe.T_map_camera;
    earlier.keyframes.push_back(keyframe);
    earlier.steps.push_back(mapper.step_uncertainties()[k]);
  }
  for (mapping::MapPoint& point : mapper.points()) {
    if (point.keyframe < next) continue;
    point.keyframe = earlier_id(point.keyframe, next);
    for (int& id : point.observing_keyframes) id = earlier_id(id, next);
    earlier.points.push_back(std::move(point));
  }
  return earlier;
}

/// Puts what was tracked backwards, the last first, before the rest.
template <class Record>
void prepend_reversed(std::vector<Record>& backwards, std::vector<Record>& records) {
  std::reverse(backwards.begin(), backwards.end());
  records.insert(records.begin(), std::make_move_iterator(backwards.begin()), std::make_move_iterator(backwards.end()));
}

}  // namespace

void track_backwards(const std::deque<InputFrame>& frames, std::size_t count, const OdometryOptions& options,
                     const Preprocessor& preprocessor, const mapping::Mapper& mapper, const KeyframeObserver& observer,
                     bool far_apart, TrackingLog& log) {
  if (count == 0) return;
  Preprocessor backwards = preprocessor;  // its lens is refined with the map
  mapping::Mapper map(mapper, backwards.lens());
  map.reverse_order();
  TrackingLog found;
  FrameTracker tracker(options, backwards, map, found, observer);
  TrackingState state =
      state_at_first_keyframe(map, backwards.lens(), log.tracked.at(0), log.tracked.at(log.tracked.size() > 1 ? 1 : 0));
  state.far_apart = far_apart;
  for (std::size_t i = count; i-- > 0 && !tracker.lost(state);) tracker.track(state, frames[i]);

  const auto next = static_cast<int>(mapper.step_uncertainties().size());
  log.earlier = earlier_map(map, next);
  log.earlier.frames_tracked = static_cast<std::int64_t>(found.tracked.size());
  for (TrackedFrame& frame : found.tracked) frame.keyframe = earlier_id(frame.keyframe, next);
  for (loop_closure::LoopKeyframe& keyframe : found.loop_keyframes) keyframe.id = earlier_id(keyframe.id, next);
  prepend_reversed(found.tracked, log.tracked);
  prepend_reversed(found.loop_keyframes, log.loop_keyframes);
  log.relocalizations += found.relocalizations;
}

}  // namespace tileflight::odometry
