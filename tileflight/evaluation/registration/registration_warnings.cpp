#include "tileflight/evaluation/registration/registration_warnings.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "tileflight/core/base/formatted_text.h"

namespace tileflight::registration {

using geometry::Sim3;
using geometry::Vec3;
using geometry::Vec7;

namespace {

constexpr const char* kAlignment = "alignment";
constexpr const char* kOdometry = "odometry";

void add_warning(RegistrationResult& r, const char* where, Severity severity, std::string what, std::string remedy) {
  r.warnings.push_back({std::move(what), where, severity, std::move(remedy)});
}

bool is_recognised(const RegistrationResult& r) { return r.method == "pictures"; }

/// Distance of the aligned trajectory from the telemetry's positions, with their standard deviations.
struct TelemetryDistance {
  Vec3 apart_m = Vec3::Zero();  ///< median along each axis
  double horizontal_sigma_m = 0.0, vertical_sigma_m = 0.0;
};

/// `r` must have telemetry. Its similarity is not what counts: on a short arc the positions' noise may look like
/// another offset of the clocks, which slides it along the path.
TelemetryDistance distance_to_telemetry(const RegistrationEvidence& evidence, const RegistrationResult& r) {
  TelemetryDistance result;
  result.apart_m = distance_to_fixes(evidence.path, evidence.positions, r.T_local_map, r.telemetry->time_offset_s);
  for (const alignment::PositionFix& fix : evidence.positions) {
    result.horizontal_sigma_m = std::max(result.horizontal_sigma_m, fix.horizontal_sigma_m);
    result.vertical_sigma_m = std::max(result.vertical_sigma_m, fix.vertical_sigma_m);
  }
  return result;
}

/// Nothing but the images says that the map belongs there: its place was searched, and no telemetry puts it there.
bool is_place_by_images_alone(const RegistrationEvidence& evidence, const RegistrationResult& r) {
  if (r.start != kSearchedStart) return false;
  if (!r.telemetry) return true;
  // Georeferences of places are off by decimetres, which counts where a receiver is better (RTK).
  constexpr double kSigmas = 3.0, kPlace_m = 1.0;
  const TelemetryDistance to = distance_to_telemetry(evidence, r);
  return to.apart_m.head<2>().norm() > std::max(kPlace_m, kSigmas * to.horizontal_sigma_m) ||
         std::abs(to.apart_m.z()) > std::max(kPlace_m, kSigmas * to.vertical_sigma_m);
}

// ---- images ----

/// Compares the path with its located images, to detect an odometry that drifts or jumps. A path counts as wrong from
/// one percent of its length on; less is an error that the path's scores have, too.
void check_path(RegistrationResult& r) {
  const PictureAgreement& p = *r.pictures;
  constexpr double kMentioned = 0.005, kWrong = 0.009, kCertain = 0.015;  // of the length; kWrong with some reserve
  constexpr double kLeast_m = 0.02;                                       // what images may be located wrongly
  if (p.path_error_m > std::max(kLeast_m, kMentioned * p.path_length_m)) {
    const double share = p.path_error_m / p.path_length_m;
    add_warning(
        r, kOdometry,
        share > kCertain ? Severity::kError
        : share > kWrong ? Severity::kWarning
                         : Severity::kNote,
        base::formatted("the path is distorted: the positions of %zu localized images differ by %.2f m (RMS) from "
                        "the best fit of the path, which is %.1f m long",
                        p.located, p.path_error_m, p.path_length_m),
        "use only the part that fits, another start frame, or a flight with less rotation in place");
  } else if (p.inliers < p.located && p.worst_m > std::max(kMinSegmentError_m, kSegmentErrorShare * p.path_length_m)) {
    add_warning(r, kOdometry, Severity::kWarning,
                base::formatted("a part of the path is off by up to %.2f m (around %.2f s): only %zu of %zu localized "
                                "images agree with the path",
                                p.worst_m, p.worst_time_s, p.inliers, p.located),
                "check the images around that time; leave that part out");
  }
}

/// Another place that was found where the images fit as well: nothing tells which one is right.
void check_similar_place(RegistrationResult& r) {
  if (!r.similar_place_distance_m) return;
  add_warning(
      r, kAlignment, Severity::kWarning,
      base::formatted("the place is ambiguous: the images fit as well %.1f m away", *r.similar_place_distance_m),
      "give telemetry, attitude or a start");
}

/// A place that resembles the right one (another roof with the same tiles) lets some of the images be located there,
/// too; where the place had to be searched, nothing else speaks for it.
void check_located_share(bool by_images_alone, RegistrationResult& r) {
  const PictureAgreement& p = *r.pictures;
  if (by_images_alone && 3 * p.inliers < 2 * p.tried) {
    add_warning(r, kAlignment, Severity::kWarning,
                base::formatted("the place was found by its resemblance, and only %zu of %zu images agree on it",
                                p.inliers, p.tried),
                "give telemetry, attitude or a start");
  } else if (3 * p.located < 2 * p.tried) {
    add_warning(r, kAlignment, Severity::kNote,
                base::formatted("only %zu of %zu images were localized in the place", p.located, p.tried),
                "check the other images: outside the place, blurred, or off the path");
  }
}

void check_pictures(bool by_images_alone, RegistrationResult& r) {
  if (!r.pictures) return;
  const PictureAgreement& p = *r.pictures;
  if (!is_recognised(r)) {
    if (2 * p.located >= p.tried) check_path(r);
    add_warning(r, kAlignment, Severity::kWarning,
                base::formatted(
                    "%zu of %zu images were localized in the textured place%s: the alignment relies on shapes alone",
                    p.located, p.tried, p.located > 0 ? ", without agreeing on one position" : ""),
                "check that the place matches the images (season, region, calibration), or give a start");
    return;
  }
  check_similar_place(r);
  check_located_share(by_images_alone, r);
  if (r.repetition_distance_m) {
    add_warning(
        r, kAlignment, Severity::kWarning,
        base::formatted(
            "the place's textures repeat: the images fit equally well %.2f m away, and the shapes do not resolve it",
            *r.repetition_distance_m),
        "fly over ground with relief, or compare with telemetry by hand");
  }
  if (p.textures_differ()) {
    add_warning(
        r, kAlignment, Severity::kNote,
        base::formatted("the images look different from the place (correlation %.2f): its textures have changed, "
                        "which makes the images' positions less accurate (the stated uncertainty allows for "
                        "that), or it is another place",
                        p.correlation),
        "register against tiles of the same season and light where there are any");
  }
  check_path(r);
}

// ---- surface ----

double ray_score(const RegistrationResult& r) { return r.rays ? r.rays->score : r.surface.inlier_share; }

/// If only the surface determines the result: is the map well constrained, and is there another place for it?
void check_shapes(RegistrationResult& r) {
  if (is_recognised(r)) return;
  if (!r.surface.converged) {
    add_warning(
        r, kAlignment, Severity::kWarning,
        base::formatted("the fit to the surface did not converge (its next step is %.3g m)", r.surface.last_step_m),
        "give a better start, or a region with more relief");
  }
  if (!r.surface.constraint.well_constrained) {
    add_warning(
        r, kAlignment, Severity::kWarning,
        "the surface hardly constrains " +
            (r.surface.constraint.weakest_motion.empty() ? std::string("any motion")
                                                         : r.surface.constraint.weakest_motion) +
            ", and no image was localized that would",
        "fly over a place with relief in several directions, or give images (--dataset) and a textured ground truth");
  }
  constexpr double kRivalShare = 0.85;
  const double score = ray_score(r);
  if (r.runner_up_distance_m && r.runner_up_score > kRivalShare * score) {
    add_warning(r, kAlignment, Severity::kWarning,
                base::formatted("ambiguous: the map fits nearly as well %.1f m (RMS) away (score %.2f against %.2f)",
                                *r.runner_up_distance_m, r.runner_up_score, score),
                "give telemetry, attitude or a start");
  }
}

/// The least ray score of a place that is believed. Where it was searched, its rays must be the better the less the
/// images resemble it. By the proving ground, images correlate by 0.48 to 0.91 in similar places, whose scores reach
/// 0.69; in nearly all right ones by 0.90 to 0.998 (once by 0.63, with few points over the region, which
/// gets a note). Over changed textures nearly all images of the whole path are located in the right place, and at most
/// seven tenths of them in the wrong ones.
double least_ray_score(bool by_images_alone, const RegistrationResult& r) {
  constexpr double kGoodRays = 0.5, kRaysOfSimilar = 0.75, kResembles = 0.95, kRaysAlongPath = 0.6, kNearlyAll = 0.97;
  if (!by_images_alone || !is_recognised(r) || r.pictures->correlation >= kResembles) return kGoodRays;
  const bool all_along = r.pictures->along_path && static_cast<double>(r.pictures->inliers) >=
                                                       kNearlyAll * static_cast<double>(r.pictures->tried);
  return all_along ? kRaysAlongPath : kRaysOfSimilar;
}

/// Whether nearly all images look as if taken there, to the grain of the textures.
bool looks_the_same(const RegistrationResult& r) {
  constexpr double kSame = 0.97, kNearlyAll = 0.95;
  return is_recognised(r) && r.pictures->correlation >= kSame &&
         static_cast<double>(r.pictures->inliers) >= kNearlyAll * static_cast<double>(r.pictures->tried);
}

/// Do the points lie where the cameras see the place's surface? Not asked where images of a place that is known agree.
/// Over clutter, rays that pass an edge meet what is behind or before: then images that look the same decide.
void check_rays(bool by_images_alone, RegistrationResult& r) {
  if (is_recognised(r) && !(by_images_alone && r.rays)) return;
  const double score = ray_score(r), least = least_ray_score(by_images_alone, r);
  if (score >= least) return;
  std::string what = base::formatted(
      "seen from its own cameras, the map does not match the place: %.0f %% of its points lie on the surface that is "
      "visible there, %.0f %% lie behind it",
      100.0 * (r.rays ? r.rays->agreeing_share : r.surface.inlier_share),
      100.0 * (r.rays ? r.rays->blocked_share : 0.0));
  if (is_recognised(r))
    what += base::formatted("; the place was found by its resemblance (correlation %.2f)", r.pictures->correlation);
  Severity severity = looks_the_same(r) ? Severity::kNote : score < 0.5 * least ? Severity::kError : Severity::kWarning;
  add_warning(r, kAlignment, severity, what, "check place, region and telemetry; give a start");
}

void check_ray_support(const ObservedPoints& points, RegistrationResult& r) {
  constexpr std::size_t kFewPoints = 300;
  constexpr double kLowShare = 0.25;
  if (r.surface.points < kFewPoints) {
    add_warning(r, kAlignment, Severity::kNote,
                base::formatted("only %zu of the map's %zu points lie over the ground truth's region", r.surface.points,
                                points.size()),
                "extract a larger region");
  } else if (r.surface.inlier_share < kLowShare) {
    add_warning(r, kAlignment, Severity::kWarning,
                base::formatted(
                    "only %.0f %% of the map's points over the region agree with the surface within their own noise",
                    100.0 * r.surface.inlier_share),
                "check that the truth is of this place and time, and complete");
  }
}

/// May the transform be off, at 95 %, by more than maps are scored by, or than the path is off anyway?
void check_sigma(RegistrationResult& r) {
  constexpr double kScored_m = 0.1, kUseless_m = 0.2, kSigmas = 2.0, kPathErrors = 3.0;
  if (std::isnan(r.sigma_m)) {
    add_warning(r, kAlignment, Severity::kNote,
                "there are too few keyframes or images to estimate the uncertainty of the transform",
                "fly a longer path, or at a higher frame rate");
    return;
  }
  // Where textures have changed, the images' distances from the path are their own errors.
  const bool tells_path_errors = is_recognised(r) && r.pictures && !r.pictures->textures_differ();
  const double path_error_m = tells_path_errors ? r.pictures->path_error_m : 0.0;
  const bool may_be_wrong = kSigmas * r.sigma_m > std::max(kScored_m, kPathErrors * path_error_m);
  if (!may_be_wrong && r.sigma_m <= kScored_m) return;
  add_warning(
      r, kAlignment,
      r.sigma_m > kUseless_m ? Severity::kError
      : may_be_wrong         ? Severity::kWarning
                             : Severity::kNote,
      base::formatted("the transform's uncertainty is %.2f m (one sigma, RMS over the map's points)", r.sigma_m),
      "fly closer, along a longer path, or over a place with more relief or texture");
}

// ---- telemetry ----

/// Compares scale, height and position with telemetry, in units of its sigmas.
void check_telemetry(const RegistrationEvidence& evidence, RegistrationResult& r) {
  if (!r.telemetry) return;
  const TelemetryEstimate by_positions =
      estimate_from_telemetry(evidence.path, evidence.positions, *r.telemetry, std::nullopt);
  const TelemetryDistance to = distance_to_telemetry(evidence, r);
  const Vec3& apart = to.apart_m;
  constexpr double kSigmas = 5.0, kLeast_m = 3.0;
  if (std::abs(apart.z()) > std::max(kLeast_m, kSigmas * to.vertical_sigma_m)) {
    add_warning(
        r, kAlignment, Severity::kWarning,
        base::formatted("the telemetry's heights are %.1f m %s than the aligned map's: possibly another vertical datum",
                        std::abs(apart.z()), apart.z() > 0.0 ? "lower" : "higher"),
        "check the height reference of the log (--telemetry-height ellipsoid, sea-level or takeoff)");
  }
  if (apart.head<2>().norm() > std::max(kLeast_m, kSigmas * to.horizontal_sigma_m)) {
    add_warning(r, kAlignment, Severity::kWarning,
                base::formatted("the telemetry's positions are %.1f m east and %.1f m north of the aligned map's",
                                -apart.x(), -apart.y()),
                "check the ground truth's georeference and the log's clock");
  }
  const double log_scale = std::log(r.T_local_map.scale / r.telemetry->T_local_map.scale);
  const double information = by_positions.estimate.information(6, 6);
  const double sigma = information > 0.0 ? 1.0 / std::sqrt(information) : 1.0;
  constexpr double kLeastScale = 0.03;
  if (std::abs(log_scale) > std::max(kLeastScale, kSigmas * sigma)) {
    add_warning(r, kAlignment, Severity::kWarning,
                base::formatted("the scale is %.3g times the telemetry's, whose uncertainty is %.1f %%",
                                std::exp(log_scale), 100.0 * sigma),
                "check that the log belongs to the video, and check the calibration");
  }
}

// ---- gravity ----

/// Wrong axes of an inertial unit show only by comparison with the final transform.
void check_gravity(const RegistrationEvidence& evidence, RegistrationResult& r) {
  if (!evidence.up) return;
  constexpr double kSigmas = 5.0, kLeast_rad = 0.1, kDegrees = 180.0 / std::numbers::pi;
  const double cosine = (r.T_local_map.rotation * evidence.up->up_map.normalized()).z();
  const double off_rad = std::acos(std::clamp(cosine, -1.0, 1.0));
  if (off_rad < std::max(kLeast_rad, kSigmas * evidence.up->sigma_rad)) return;
  add_warning(r, kAlignment, is_recognised(r) ? Severity::kNote : Severity::kWarning,
              base::formatted("the map's up direction is %.0f degrees away from %s", kDegrees * off_rad,
                              evidence.up->given ? "--up" : "the inertial unit's gravity"),
              evidence.up->given
                  ? "check --up: the direction opposite to gravity in the map's frame"
                  : "check T_cam_imu of the calibration, which maps the inertial unit's axes to the camera's");
}

}  // namespace

void add_registration_warnings(const ObservedPoints& points, const RegistrationEvidence& evidence,
                               RegistrationResult& registration) {
  const bool by_images_alone = is_place_by_images_alone(evidence, registration);
  check_pictures(by_images_alone, registration);
  check_shapes(registration);
  check_rays(by_images_alone, registration);
  check_ray_support(points, registration);
  check_sigma(registration);
  check_telemetry(evidence, registration);
  check_gravity(evidence, registration);
}

}  // namespace tileflight::registration
