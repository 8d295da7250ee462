#pragma once

// Registration of a map to its place by all available evidence: shape, telemetry, and images. Several starts are
// refined; the final choice uses criteria that none of them minimised (free space along rays, images recognised in the
// place), and remaining problems are reported as warnings.

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/core/base/progress.h"
#include "tileflight/core/base/warning.h"
#include "tileflight/evaluation/registration/located_poses.h"
#include "tileflight/evaluation/registration/ray_agreement.h"
#include "tileflight/evaluation/registration/surface_fit.h"
#include "tileflight/evaluation/registration/telemetry_estimate.h"

namespace tileflight::registration {

/// The ground truth's surface.
struct GroundTruthSurface {
  const geometry::TriangleIndex& index;
  const geometry::TriangleMesh& mesh;
  std::vector<geometry::Box3> regions{};  ///< regions covered by ground truth; empty: everywhere
};

/// Evidence besides the shapes; every part is optional.
struct RegistrationEvidence {
  geometry::Trajectory path;                      ///< T_map_camera
  std::vector<alignment::PositionFix> positions;  ///< local frame
  std::vector<AttitudeFix> attitudes;             ///< local frame
  std::optional<UpDirection> up;                  ///< of the map
  std::vector<geometry::Sim3> starts;             ///< given transforms, map to local
};

/// An image of the path, located in the textured place.
struct LocatedPicture {
  std::size_t pose = 0;  ///< of the path
  LocatedPose found;
  double correlation = 0.0;  ///< of rendered and observed grey values
};

struct LocatedPictures {
  std::size_t tried = 0;
  std::vector<LocatedPicture> found;
  bool along_path = false;  ///< the images were located together: a better start finds no more of them
};

/// Accuracy of image localization.
enum class PictureDetail {
  kCoarse,  ///< sufficient to recognise the place
  kFine     ///< full accuracy
};

/// Callbacks used by the registration; each may be empty.
struct RegistrationServices {
  RayCast cast_ray;
  /// Locates `pictures` images, evenly spread over the path, starting from the poses given by a transform.
  std::function<LocatedPictures(const geometry::Sim3& T_local_map, std::size_t pictures, PictureDetail detail)>
      locate_pictures;
  /// Placements by appearance, best first, without a start; called if no other start is convincing.
  std::function<std::vector<geometry::Sim3>()> find_places_by_appearance;
  /// Placements by shape, best first; called if those by appearance are not convincing either.
  std::function<std::vector<geometry::Sim3>()> find_places_by_shape;
};

/// Agreement of the located images with a transform.
struct PictureAgreement {
  std::size_t tried = 0, located = 0, inliers = 0;  ///< images tried, located, and consistent with one similarity
  double correlation = 0.0;                         ///< mean over the inliers
  double path_error_m = 0.0;   ///< RMS distance of all located positions from the path, after the best similarity
  double inlier_rms_m = 0.0;   ///< RMS distance of the inliers from the transformed path
  double worst_m = 0.0;        ///< largest distance of a located position from the transformed path
  double worst_time_s = 0.0;   ///< time of worst_m
  double path_length_m = 0.0;  ///< length of the located part of the path
  bool along_path = false;     ///< LocatedPictures::along_path
  std::optional<SimilarityEstimate> estimate{};  ///< by the inliers; nullopt: there are too few

  /// Tells whether the images look so different that the place's textures must have changed. By the proving ground,
  /// images of unchanged textures correlate by 0.9 and more, those of another season by 0.63 to 0.76.
  bool textures_differ() const { return correlation < 0.85; }
};

struct RegistrationOptions {
  std::size_t coarse_points = 4000;  ///< map points used while starts are compared
  std::size_t fine_points = 60000;   ///< map points used for the final fit
  std::vector<double> coarse_radii_m = {8.0, 4.0, 2.0, 1.0};
  std::size_t coarse_pictures = 8;  ///< images used to compare starts
  std::size_t fine_pictures = 20;   ///< images whose resemblance counts; ten times as many are used for the final fit
  double max_scale_change = 1.3;    ///< largest change of scale from the start
  alignment::ScaleMode scale = alignment::ScaleMode::kEstimated;
  std::vector<geometry::Box3> regions{};  ///< for the final fit: only points inside any of these; none: all points over
                                          ///< the truth
  alignment::AlignTrajectoryOptions trajectory{};
};

/// RegistrationResult::start of a place that was found without a start.
inline constexpr const char* kSearchedStart = "places";

struct RegistrationResult {
  geometry::Sim3 T_local_map;
  double sigma_m = 0.0;  ///< calibrated standard deviation of the points' positions: RMS over points and noise
  std::string start;     ///< "positions", "positions and attitude", "positions and gravity", "given", "places"
  std::string method;    ///< "pictures" or "surface": evidence that determines the final transform
  SurfaceFit surface;    ///< final fit to the surface
  std::optional<RayAgreement> rays;
  std::optional<PictureAgreement> pictures;
  std::optional<alignment::TrajectoryAlignment> telemetry;
  double moved_from_start_m = 0.0;  ///< RMS over the points
  std::size_t starts_tried = 0;
  std::optional<double> runner_up_distance_m;  ///< distance of the best alternative result, RMS over the points
  double runner_up_score = 0.0;                ///< ray agreement of the best alternative
  std::optional<double>
      repetition_distance_m;  ///< distance to a nearby placement where the images fit equally well (repeating textures)
  std::optional<double> similar_place_distance_m;  ///< distance to another place, of those that were found without a
                                                   ///< start, where the images fit as well, RMS over the points
  Warnings warnings;
};

/// Registers a map. Throws InputError for a map without points, and if no evidence gives a start and no place is found.
RegistrationResult register_map(const ObservedPoints& points, const RegistrationEvidence& evidence,
                                const GroundTruthSurface& surface, const RegistrationServices& services,
                                const RegistrationOptions& options = {}, const Progress& progress = {});

}  // namespace tileflight::registration
