#pragma once

// One bundle adjustment of all segments, which share the lens: reprojection errors (Huber) over corners, poses and
// lens, by Levenberg and Marquardt, with the corners and then each segment's poses eliminated (Schur complement). The
// lens has a prior: what the motion does not show stays where it is.

#include <array>
#include <cstddef>
#include <optional>
#include <vector>

#include "tileflight/slam/self_calibration/lens_parameters.h"
#include "tileflight/slam/self_calibration/segment_structure.h"

namespace tileflight::self_calibration {

/// Holds the lens and the structure of each segment; nullopt: it has none.
struct FlightStructure {
  LensParameters lens;
  std::vector<std::optional<SegmentStructure>> segments;
};

/// Selects the unknowns of the lens that are adjusted, and what is known of them beforehand.
struct LensPrior {
  LensVector mean = LensVector::Zero();
  LensVector sigma = LensVector::Ones();
  std::array<bool, kLensUnknowns> is_free{};
};

/// Holds errors of the corners that fit.
struct FitQuality {
  std::size_t points = 0;  ///< corners
  std::size_t pixels = 0;
  double rms_px = 0.0;
  double noise_px = 0.0;  ///< standard deviation of a coordinate, by the median error
};

/// Minimises over all unknowns from `flight`. `noise_px`: standard deviation of a pixel's coordinates, which weighs the
/// prior. Returns the quality.
FitQuality adjust(const std::vector<Segment>& segments, const LensPrior& prior, double noise_px, int iterations,
                  FlightStructure& flight);

/// Decides which corners fit: those whose largest reprojection error is at most a limit, which is `sigmas` times the
/// noise that the median error of all known corners shows, at least `least_px`. Corners that fitted before and those
/// that did not are judged alike.
FitQuality select_corners(const std::vector<Segment>& segments, double sigmas, double least_px,
                          FlightStructure& flight);

/// Returns the mean over all pixels of the tracks of the squared error, truncated at `limit_px`: compares lenses whose
/// structures differ. Pixels of tracks without structure have the limit.
double truncated_cost_px2(const std::vector<Segment>& segments, double limit_px, const FlightStructure& flight);

/// Returns standard deviations of the lens's unknowns; zero of those that are not free. The largest of three estimates
/// counts: by independent errors of the pixels, scaled by their variance; by the spread of the contributions of groups
/// of corners that begin in one keyframe, since errors along a track and of tracks side by side are correlated; and by
/// the spread of the segments' (Liang and Zeger, Biometrika 73(1), 1986).
struct LensUncertainty {
  LensVector sigma = LensVector::Zero();
  LensVector independent_sigma = LensVector::Zero();  ///< the first estimate alone
  LensVector segment_sigma = LensVector::Zero();      ///< the third; zero for fewer than four segments
};
LensUncertainty lens_uncertainty(const std::vector<Segment>& segments, const LensPrior& prior, double noise_px,
                                 const FlightStructure& flight);

}  // namespace tileflight::self_calibration
