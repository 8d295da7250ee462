#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/core/base/progress.h"
#include "tileflight/core/imaging/camera.h"
#include "tileflight/core/imaging/image.h"
#include "tileflight/experiments/project/choice.h"
#include "tileflight/experiments/project/excerpt.h"
#include "tileflight/experiments/project/recording.h"
#include "tileflight/tiles/fetch/open_source.h"

namespace tileflight::project {

/// Names the place of a flight, and says how the part of the recording is chosen.
struct SiteOptions {
  std::string source;                        ///< SOURCE of the contract
  std::optional<geometry::Geodetic> origin;  ///< of a tileset that is not georeferenced
  fetch::SourceOptions source_options;
  /// Chooses the part of the recording to use, once the heights above the ground are known.
  std::function<Excerpt(const std::vector<TrackSample>& track, bool above_ground)> choose_excerpt;
};

/// Holds the choices for the sections `place` and `truth` and for the heights of the log.
struct Site {
  std::vector<Choice> choices;
  std::vector<std::string> warnings;
  std::optional<Excerpt> excerpt;        ///< nullopt: the positions say nothing of it
  std::optional<double> usual_height_m;  ///< above the ground, in the excerpt
  imaging::RgbImage map;                 ///< the place from above with flight and region
};

/// Chooses the region by the flight's positions and what the camera sees from them, the voxel edge, and the height
/// reference of the log: what it states, else heights above a take-off point on the place's ground, else the one by
/// which the flight begins on the ground, else sea level, if that is above the ground. A reference that puts the flight
/// below the ground is a warning. Without positions, or for a place without georeference and origin, the region is the
/// one that `inspect --map` proposes. Throws InputError: a place that cannot be read, a flight elsewhere.
Site choose_site(const SiteOptions& options, const Recording& recording, const imaging::Camera& camera,
                 const Progress& progress = {});

/// Chooses the height reference of a log where no place can check it: what it states, else sea level, else take-off.
std::vector<Choice> choose_height_reference(const Recording& recording);

}  // namespace tileflight::project
