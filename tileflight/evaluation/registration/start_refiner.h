#pragma once

// A start of the registration, and what becomes of it: fitted to the surface, and compared with the images.

#include <optional>
#include <string>
#include <vector>

#include "tileflight/evaluation/registration/register_map.h"

namespace tileflight::registration {

/// A start of the registration.
struct Start {
  geometry::Sim3 T;
  std::string name;
  std::optional<SimilarityEstimate> known{};  ///< estimate from telemetry, near T
};

/// Result of refining a start, with its evidence.
struct Candidate {
  Start start;
  geometry::Sim3 T;
  SurfaceFit fit;
  std::optional<RayAgreement> rays;
  std::optional<PictureAgreement> pictures;

  bool is_recognised() const {
    return pictures && 2 * pictures->located >= pictures->tried && pictures->inliers >= 4 &&
           3 * pictures->inliers >= 2 * pictures->located;
  }
  double ray_score() const { return rays ? rays->score : fit.inlier_share; }
};

class StartRefiner {
 public:
  /// All must outlive the refiner, except `points`.
  StartRefiner(const ObservedPoints& points, const RegistrationEvidence& evidence, const GroundTruthSurface& surface,
               const RegistrationServices& services, const RegistrationOptions& options);

  SurfaceFitOptions fit_options(const Start& start, std::vector<double> radii_m) const;
  std::optional<RayAgreement> rays(const geometry::Sim3& T) const;
  /// Fits a start to the surface and computes its ray agreement. Does not compare its images.
  Candidate refine(const Start& start) const;

  /// Compares the images with `T`, which is moved to the fit of the located poses.
  std::optional<PictureAgreement> check_pictures(geometry::Sim3& T, std::size_t pictures,
                                                 PictureDetail detail = PictureDetail::kCoarse) const;

  /// Subsampled map points for comparing starts.
  const ObservedPoints& coarse_points() const { return coarse_points_; }
  /// Median distance of the points from their viewpoints, metres; 0 if unknown.
  double viewing_distance_m(const geometry::Sim3& T) const;

 private:
  ObservedPoints coarse_points_;
  const RegistrationEvidence& evidence_;
  const GroundTruthSurface& surface_;
  const RegistrationServices& services_;
  const RegistrationOptions& options_;
};

}  // namespace tileflight::registration
