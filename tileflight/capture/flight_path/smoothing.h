#pragma once

#include <optional>
#include <string>

namespace tileflight::base {
class StrictSection;
}

namespace tileflight::flight_path {

/// How strongly a path through measured poses is smoothed. The knot spacing decides it; if it is not given, it is
/// chosen from the noise if that is known, else by generalized cross validation.
struct SmoothingOptions {
  std::optional<double> knot_spacing_s = {};      ///< for positions and rotations
  std::optional<double> position_sigma_m = {};    ///< noise of a pose on each axis
  std::optional<double> rotation_sigma_rad = {};  ///< noise of a pose about each axis
};

/// Reads the key `smooth` of a section: `none` (interpolate every pose), `auto`, or seconds between knots. Returns
/// `fallback` if the key is absent. Throws InputError for anything else.
std::optional<SmoothingOptions> read_smoothing(base::StrictSection& section,
                                               const std::optional<SmoothingOptions>& fallback);

/// Describes the smoothing in words.
std::string smoothing_text(const std::optional<SmoothingOptions>& smoothing);

}  // namespace tileflight::flight_path
