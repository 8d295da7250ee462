#pragma once

// Static stereo: inverse distances of a keyframe's immature points from what the rig's other cameras took at the same
// instant (Wang, Schwoerer, Cremers, "Stereo DSO", ICCV 2017), searched along the epipolar curve of each camera's own
// lens as from one keyframe to the next (tracer.h). Points that do not project into a stereo picture keep what they
// had.

#include <vector>

#include "tileflight/slam/keyframes/keyframe.h"
#include "tileflight/slam/keyframes/options.h"

namespace tileflight::mapping {

/// Counts the points of a search in one stereo picture.
struct StereoMatches {
  int searched = 0;  ///< points whose epipolar curve lies in the picture
  int found = 0;     ///< of those: with a match that leads back
};

/// Searches the keyframe's immature points in its stereo pictures, by camera of the window. A match counts if the
/// search from it leads back to the point. `lens`: the reference camera's. If few points of a picture match, another
/// brightness is tried for it, from the means of both pictures; if few match then, too, the picture is taken from the
/// keyframe: it shows something else (a covered lens, a wrong calibration). The result does not depend on the number of
/// threads.
std::vector<StereoMatches> trace_stereo(const keyframes::Window& window, const keyframes::Lens& lens,
                                        const keyframes::OdometryOptions& options, keyframes::Keyframe& keyframe);

/// Activates those immature points of a window's only keyframe that its stereo pictures have determined, and optimises
/// them: a map from one instant. Returns the number of points that are left; the window is without points if they are
/// too few or too far away to start from (fewer than 50 known to a quarter of their distance).
int start_from_stereo(keyframes::Window& window, const keyframes::Lens& lens,
                      const keyframes::OdometryOptions& options);

}  // namespace tileflight::mapping
