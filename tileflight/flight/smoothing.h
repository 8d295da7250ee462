#pragma once

#include <optional>
#include <string>

#include "tileflight/geometry/yaml_section.h"

namespace tileflight::flight {

/// How much a path through measured poses is smoothed. The distance between knots decides it; without one it comes from
/// the noise where that is known, else from the data by generalised cross validation.
struct SmoothingOptions {
  std::optional<double> knot_spacing_s = {};      ///< of positions and rotations
  std::optional<double> position_sigma_m = {};    ///< of a pose, on each axis
  std::optional<double> rotation_sigma_rad = {};  ///< of a pose, about each axis
};

/// The key `smooth` of a section: `none` (through every pose), `auto`, or seconds between knots; without it
/// `otherwise`. Throws InputError for anything else.
std::optional<SmoothingOptions> read_smoothing(geometry::YamlSection& section,
                                               const std::optional<SmoothingOptions>& otherwise);

/// The same in words.
std::string smoothing_text(const std::optional<SmoothingOptions>& smoothing);

}  // namespace tileflight::flight
