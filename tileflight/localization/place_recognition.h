#pragma once

// Where a flight was, found by its looks: the ground as its pictures show it from above is looked for in the place as
// its textures show it from above. Nothing but the pictures and what odometry made of them is needed.

#include <memory>
#include <vector>

#include "tileflight/localization/flight_mosaic.h"
#include "tileflight/localization/orthophoto.h"
#include "tileflight/scene/scene.h"

namespace tileflight::localization {

struct PlaceRecognitionOptions {
  OrthophotoOptions orthophoto{};
  MosaicOptions mosaic{};
  std::size_t mosaic_features = 4000;  ///< at most, of highest contrast
  std::size_t similarities = 120;      ///< for each direction of up, that are compared with the place
  std::size_t candidates = 8;          ///< at most
};

/// A flight without telemetry.
struct FlightEvidence {
  FlightPictures pictures;
  std::vector<geometry::Vec3> points;  ///< of the map
  std::vector<geometry::Vec3> ups;     ///< unit directions of the map that may be up; each is tried
};

/// Where the flight may have been.
struct PlaceCandidate {
  geometry::Sim3 T_local_map;
  std::size_t inliers = 0;   ///< pairs of features that agree on it
  double correlation = 0.0;  ///< of grey values of even contrast, mosaic and place
  double heights = 0.0;      ///< share of the mosaic's heights that agree with the place's
  double share = 0.0;        ///< of the mosaic that lies on the place

  /// From 0 to 1; a right one is seldom below 0.2, a wrong one seldom above 0.3.
  double value() const { return correlation * heights * share; }
};

class PlaceRecognizer {
 public:
  /// `box`: over which there is truth. `appearance`: the scene's, where there is one already (it holds all textures
  /// once more). Neither scene nor appearance is kept.
  PlaceRecognizer(const scene::Scene& scene, const geometry::Box3& box, const PlaceRecognitionOptions& options = {},
                  std::shared_ptr<const sensors::Appearance> appearance = {});
  ~PlaceRecognizer();
  PlaceRecognizer(const PlaceRecognizer&) = delete;
  PlaceRecognizer& operator=(const PlaceRecognizer&) = delete;

  /// Best first, at clearly different places; none where the place has no texture, or the flight shows no ground around
  /// its points. Same bytes for any number of threads. Throws InputError for pictures of another size than the
  /// camera's.
  std::vector<PlaceCandidate> find(const FlightEvidence& flight) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tileflight::localization
