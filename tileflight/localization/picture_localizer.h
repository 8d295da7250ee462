#pragma once

// Where a picture was taken, found by aligning it with what the textured place looks like from nearby. It knows nothing
// of a map's points, so that it is a witness of its own for an alignment that was made of them.

#include <memory>
#include <optional>

#include "tileflight/imaging/camera.h"
#include "tileflight/imaging/image.h"
#include "tileflight/scene/scene.h"

namespace tileflight::sensors {
class Appearance;  // appearance.h
}

namespace tileflight::localization {

using Mat6 = Eigen::Matrix<double, 6, 6>;

struct LocalizerOptions {
  int width = 960;                  ///< pictures are shrunk to at most this, pixels
  int points = 2500;                ///< pixels that stand out, in the predicted picture
  int rounds = 4;                   ///< of predicting again from where the last round ended, at most
  double contrast_window = 0.1;     ///< side of the window over which contrast is made even, as a share of the width
  double least_share = 0.15;        ///< of the predicted points that must be in view
  double least_correlation = 0.35;  ///< of predicted and seen grey values at the points
};

struct LocatedPicture {
  geometry::SE3 T_local_camera;
  /// Of a small motion of the camera in its own axes, T_local_camera exp(x), translation (m) first: the inverse of the
  /// covariance that the pixels' noise gives.
  Mat6 information = Mat6::Zero();
  double correlation = 0.0;  ///< of predicted and seen grey values at the points
  double share_in_view = 0.0;
  double rmse = 0.0;  ///< grey values after the contrast was made even
};

class PictureLocalizer {
 public:
  /// The scene must outlive it. `camera`: the lens of the pictures.
  PictureLocalizer(const scene::Scene& scene, const imaging::Camera& camera, const LocalizerOptions& options = {});
  /// With what another localizer or camera in the same scene uses too.
  PictureLocalizer(const scene::Scene& scene, std::shared_ptr<const sensors::Appearance> appearance,
                   const imaging::Camera& camera, const LocalizerOptions& options = {});
  ~PictureLocalizer();
  PictureLocalizer(const PictureLocalizer&) = delete;
  PictureLocalizer& operator=(const PictureLocalizer&) = delete;

  /// From a guess that is within some twentieth of the picture. nullopt where the picture does not agree with the place
  /// as seen from there: another place, nothing of the place in view, textures of another season. Throws InputError for
  /// a picture of another size than the camera's.
  std::optional<LocatedPicture> locate(const imaging::RgbImage& picture,
                                       const geometry::SE3& T_local_camera_guess) const;

  /// Of the scene: to be shared, as it holds all textures once more.
  std::shared_ptr<const sensors::Appearance> appearance() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tileflight::localization
