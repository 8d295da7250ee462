#pragma once

#include <optional>
#include <vector>

#include "tileflight/experiments/project/choice.h"
#include "tileflight/experiments/project/image_motion.h"

namespace tileflight::project {

/// Holds of a logged position what decides whether the flight is worth tracking there.
struct TrackSample {
  double time_s = 0.0;    ///< on the video's clock
  double height_m = 0.0;  ///< above the ground, or above the take-off point
  bool is_inside = true;  ///< whether the place has a surface below
};

/// States which part of a recording to use.
struct Excerpt {
  double from_s = 0.0;
  std::optional<double> to_s;   ///< nullopt: to the end
  std::vector<Choice> choices;  ///< from and to
};

/// Leaves out take-off and landing, and what lies outside the place. The flight proper begins when it first reaches 70
/// % of its usual height (the median of all heights above 3 m), if it starts below 30 % of it, and ends likewise.
/// `above_ground`: whether the heights are above the ground. Times outside 0 to `duration_s` do not count.
Excerpt choose_excerpt(const std::vector<TrackSample>& track, bool above_ground, double duration_s);

/// Leaves out the parts at the beginning and the end in which the image stands still (less than 0.5 % of its width a
/// second), for a recording without heights.
Excerpt choose_excerpt_by_motion(const std::vector<MotionSample>& motion, double duration_s);

/// Replaces the ends of an excerpt by those that were given. An end that was chosen stays, unless nothing would be
/// left.
Excerpt with_given_ends(Excerpt chosen, std::optional<double> from_s, std::optional<double> to_s);

/// Leaves of an excerpt only the longest part without a break, if it lasts two seconds or more.
Excerpt leave_out_breaks(Excerpt excerpt, const std::vector<Break>& breaks, double duration_s);

}  // namespace tileflight::project
