#pragma once

// Place recognition from images: an orthographic mosaic of the flight's images is matched with an orthophoto of the
// textured place. Needs only the images and the odometry's result.

#include <memory>
#include <vector>

#include "tileflight/evaluation/localization/flight_mosaic.h"
#include "tileflight/evaluation/localization/orthophoto.h"
#include "tileflight/world/scene/scene.h"

namespace tileflight::localization {

struct PlaceRecognitionOptions {
  OrthophotoOptions orthophoto{};
  MosaicOptions mosaic{};
  std::size_t max_mosaic_features = 4000;  ///< maximum number, those of highest contrast
  std::size_t max_similarities = 120;      ///< similarities compared with the place, for each up direction
  std::size_t max_candidates = 8;          ///< maximum number of results
};

/// A flight without telemetry.
struct FlightEvidence {
  FlightPictures pictures;
  std::vector<geometry::Vec3> points;         ///< of the map
  std::vector<geometry::Vec3> up_candidates;  ///< candidate up directions, unit, map frame; each is tried
};

/// A possible placement of the flight.
struct PlaceCandidate {
  geometry::Sim3 T_local_map;
  std::size_t inliers = 0;        ///< feature pairs consistent with it
  double correlation = 0.0;       ///< of locally normalised grey values of mosaic and place
  double height_agreement = 0.0;  ///< share of the mosaic's heights that agree with the place's
  double overlap = 0.0;           ///< of the mosaic that lies on the place

  /// From 0 to 1; correct placements are seldom below 0.2, wrong ones seldom above 0.3.
  double score() const { return correlation * height_agreement * overlap; }
};

class PlaceRecognizer {
 public:
  /// `box`: region with ground truth. `appearance`: of the scene, if it exists already (it holds a copy of all
  /// textures). Neither scene nor appearance is kept.
  PlaceRecognizer(const scene::Scene& scene, const geometry::Box3& box, const PlaceRecognitionOptions& options = {},
                  std::shared_ptr<const render::Appearance> appearance = {});
  ~PlaceRecognizer();
  PlaceRecognizer(const PlaceRecognizer&) = delete;
  PlaceRecognizer& operator=(const PlaceRecognizer&) = delete;

  /// Finds placements, best first, at clearly different places. The list is empty if the place has no texture or the
  /// flight shows no ground around its points. Independent of the number of threads. Throws InputError if images differ
  /// in size from the camera.
  std::vector<PlaceCandidate> find(const FlightEvidence& flight) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tileflight::localization
