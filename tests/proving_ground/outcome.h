#pragma once

// This file judges a flight over the proving ground by the true poses, which the program under test never saw.

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "path_sigmas.h"
#include "random_flight.h"
#include "tileflight/core/geometry/point_cloud.h"
#include "tileflight/core/geometry/trajectory.h"

namespace tileflight::proving_ground {

/// Errors of an odometry and a transform against the true poses.
struct TrueErrors {
  double ate_m = 0.0;     ///< after the best similarity of the positions
  double path_m = 0.0;    ///< length of the true path
  double offset_m = 0.0;  ///< RMS over the nearer nine tenths of the map's points of |T p - T_true p|, T_true from all
                          ///< true poses, turns included
  double scale_error = 0.0;  ///< scale over the true one, minus one
};

/// Throws InputError when fewer than three poses share a time.
TrueErrors true_errors(const geometry::PointCloud& map, const geometry::Trajectory& estimate,
                       const geometry::Trajectory& truth, const geometry::Sim3& T_local_map);

struct Outcome {
  std::string name, place;
  std::string change;  ///< of the filmed place against the one that is registered against
  FlightDraw draw;
  std::string stage;  ///< the last one that was done: "odometry", "align" or "evaluate"
  std::string error;  ///< what the next one said
  int frames = 0, tracked = 0;
  TrueErrors errors;
  std::optional<PathSigmas> path_sigmas;  ///< whether the odometry's own are right
  double sigma_m = 0.0;                   ///< that the transform says of itself; 0: none
  std::vector<std::string> warnings;      ///< all that the program said, odometry to scores
  bool withheld = false;  ///< one of them is an error or a warning, so that no verdict may rest on the map
  double seconds = 0.0;

  /// Within max(0.1 m, 3 ATE), and the path within a hundredth of its length.
  bool is_right() const;
  /// Notes stand beside a verdict; they neither hide nor excuse an error.
  bool has_warning() const { return withheld || !error.empty(); }
  /// Returns whether nothing at all was reported. This is stricter than "SILENT", which a note does not lift.
  bool is_without_a_word() const { return warnings.empty() && error.empty(); }
  /// "right", "false warning", "warned" or "SILENT".
  std::string verdict() const;
};

nlohmann::json to_json(const Outcome& outcome);
Outcome outcome_from_json(const nlohmann::json& object);

/// The table by kind, place, lens, view, aids, height and camera, and the list of what went wrong, as Markdown.
std::string summary(const std::vector<Outcome>& outcomes);

}  // namespace tileflight::proving_ground
