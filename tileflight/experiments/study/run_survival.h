#pragma once

#include <cstddef>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/core/geometry/trajectory.h"

namespace tileflight::study {

/// States how far a system came on a flight before its path ended, had a gap or broke.
struct RunSurvival {
  double distance_m = 0.0;  ///< flown until then, or the whole flight
  bool failed = false;      ///< false: the path is whole to the flight's end
  std::string reason;       ///< of the failure
};

/// Finds the first failure of an estimated path: no pose for more than a second and three steps of
/// the true path (also at the end of the flight), or a
/// stretch, a tenth of the flight long, over which the path does not fit the true one by rotation, position and scale
/// (RMS above 5 % of the stretch), or whose scale differs from that of the stretches before by more than a third. What
/// was flown before the first pose counts: a system may start late. A path without poses fails at 0. A flight
/// that stands still has no stretches. Distances are of
/// the true path.
RunSurvival measure_survival(const geometry::Trajectory& estimate, const geometry::Trajectory& truth);

/// A step of a survival curve: from this distance on, this share has not failed.
struct SurvivalStep {
  double distance_m = 0.0;
  double share = 1.0;
  double low = 1.0, high = 1.0;  ///< 95 %, by Greenwood's variance of log(-log(share)); runs count as independent
  std::size_t at_risk = 0;       ///< runs that came this far
};

/// Estimates the share of runs that have not failed against the distance, by Kaplan and Meier (JASA 53, 1958): a flight
/// that ended well is censored at its length. Steps are at failures only, by distance.
std::vector<SurvivalStep> survival_curve(std::vector<RunSurvival> runs);

/// Returns the share of a curve at a distance.
double share_at(const std::vector<SurvivalStep>& curve, double distance_m);

/// Returns a list of {distance, share, interval, at_risk}.
nlohmann::json to_json(const std::vector<SurvivalStep>& curve);

}  // namespace tileflight::study
