#pragma once

// Registration of a map to its place by all that is known: the shapes, telemetry, and the pictures themselves. Several
// starts are followed; which one is right is decided by what none of them minimised (free space along the rays,
// pictures that are recognised in the place), and what stays doubtful is said.

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/alignment/evidence.h"
#include "tileflight/alignment/located_poses.h"
#include "tileflight/alignment/ray_agreement.h"
#include "tileflight/alignment/surface_fit.h"
#include "tileflight/geometry/doubt.h"
#include "tileflight/geometry/progress.h"

namespace tileflight::alignment {

/// The ground truth's surface.
struct Surface {
  const geometry::TriangleIndex& index;
  const geometry::TriangleMesh& mesh;
  std::vector<geometry::Box3> regions{};  ///< over which there is truth; empty: everywhere
};

/// What is known beside the shapes; all of it optional.
struct RegistrationEvidence {
  geometry::Trajectory path;           ///< T_map_camera
  std::vector<PositionFix> positions;  ///< local frame
  std::vector<AttitudeFix> attitudes;  ///< local frame
  std::optional<UpDirection> up;       ///< of the map
  std::vector<geometry::Sim3> starts;  ///< map to local, given
};

/// A picture of the path that was looked for in the textured place.
struct LocatedPicture {
  std::size_t pose = 0;  ///< of the path
  LocatedPose found;
  double correlation = 0.0;  ///< of predicted and seen grey values
};

struct LocatedPictures {
  std::size_t tried = 0;
  std::vector<LocatedPicture> found;
};

/// How closely pictures are looked at.
enum class PictureDetail {
  kCoarse,  ///< enough to recognise the place
  kFine     ///< as exactly as they tell
};

/// What the registration asks of others; each may be missing.
struct RegistrationServices {
  RayCast cast;
  /// Looks for so many pictures, evenly over the path, from where a transform puts them.
  std::function<LocatedPictures(const geometry::Sim3& T_local_map, std::size_t pictures, PictureDetail detail)> locate;
  /// Places that look like the flight's pictures, best first, without any start: asked where nothing else convinces.
  std::function<std::vector<geometry::Sim3>()> recognize_places;
  /// Places where the map may belong by other means (its shape), best first: asked where those do not convince either.
  std::function<std::vector<geometry::Sim3>()> look_for_places;
};

/// What the pictures say of a transform.
struct PictureAgreement {
  std::size_t tried = 0, located = 0, agreeing = 0;  ///< agreeing: on one similarity
  double correlation = 0.0;                          ///< mean of the agreeing ones
  double path_error_m = 0.0;  ///< RMS of all located positions from the path, after the best similarity of all
  double residual_m = 0.0;    ///< RMS of the agreeing positions from the path as carried over
  double worst_m = 0.0;       ///< largest distance of a located position from the path as carried over
  double worst_time_s = 0.0;  ///< and when
  double path_m = 0.0;        ///< length of the located part of the path
};

struct RegistrationOptions {
  std::size_t coarse_points = 4000;  ///< of the map, while starts are compared
  std::size_t fine_points = 60000;   ///< of the map, for the end
  std::vector<double> coarse_radii_m = {8.0, 4.0, 2.0, 1.0};
  std::size_t few_pictures = 8;    ///< to compare starts by
  std::size_t many_pictures = 20;  ///< for the end
  double max_scale_change = 1.3;   ///< of the fit, from its start's
  ScaleMode scale = ScaleMode::kEstimated;
  std::vector<geometry::Box3> regions{};  ///< of the end: points in any of these only; none: all over the truth
  AlignTrajectoryOptions trajectory{};
};

struct Registration {
  geometry::Sim3 T_local_map;
  double sigma_m = 0.0;  ///< RMS over points and noise of how far errors move the points, calibrated
  std::string start;     ///< "positions", "positions and attitude", "positions and gravity", "given", "places"
  std::string method;    ///< "pictures" or "surface": what the end rests on
  SurfaceFit surface;    ///< by the shapes, at the end
  std::optional<RayAgreement> rays;
  std::optional<PictureAgreement> pictures;
  std::optional<TrajectoryAlignment> telemetry;
  double moved_from_start_m = 0.0;  ///< RMS over the points
  std::size_t starts_tried = 0;
  std::optional<double> rival_apart_m;  ///< of the best other end, and
  double rival_score = 0.0;             ///< its ray agreement
  std::optional<double>
      repeated_apart_m;  ///< of another place near by where the pictures fit as well (textures repeat)
  Doubts doubts;
};

/// Throws InputError for a map without points, and where nothing says where to begin and no place is found.
Registration register_map(const ObservedPoints& points, const RegistrationEvidence& evidence, const Surface& surface,
                          const RegistrationServices& services, const RegistrationOptions& options = {},
                          const Progress& progress = {});

}  // namespace tileflight::alignment
