#pragma once

// Localization of an image by direct alignment with renderings of the textured place. It does not use the map's points,
// so it is independent evidence for an alignment made from them.

namespace tileflight::render {
class Appearance;  // appearance.h
}

#include <memory>
#include <optional>

#include "tileflight/core/imaging/camera.h"
#include "tileflight/core/imaging/image.h"
#include "tileflight/world/scene/scene.h"

namespace tileflight::localization {

/// Normalises local contrast: subtracts the local mean and divides by the local standard deviation over a square window
/// of 2 reach + 1 pixels (clipped at the borders), then scales to mean 128 and standard deviation 40. This removes
/// lighting, exposure, vignetting and texture tone that vary over more than the window. `least_deviation` is added to
/// the local deviation, so that noise in uniform areas stays small.
imaging::FloatImage normalize_local_contrast(const imaging::FloatImage& image, int reach, float least_deviation = 4.0F);

using Mat6 = Eigen::Matrix<double, 6, 6>;

struct LocalizerOptions {
  int width = 960;                  ///< images are downscaled to at most this width, pixels
  int points = 2500;                ///< selected high-gradient pixels of the rendered image
  int max_rounds = 4;               ///< maximum number of renderings, each from the pose found by the last round
  double contrast_window = 0.1;     ///< side of the window of local contrast normalisation, as a share of the width
  double min_share_in_view = 0.15;  ///< smallest share of the rendered points in view
  double min_correlation = 0.35;    ///< of rendered and observed grey values at the points
};

struct LocalizationResult {
  geometry::SE3 T_local_camera;
  /// Information matrix of a small motion x of the camera in its own axes, T_local_camera exp(x), translation (m)
  /// first, rotation (rad): inverse of the covariance due to pixel noise.
  Mat6 information = Mat6::Zero();
  double correlation = 0.0;  ///< of rendered and observed grey values at the points
  double share_in_view = 0.0;
  double rmse = 0.0;  ///< after contrast normalisation, grey values
};

class PictureLocalizer {
 public:
  /// The scene must outlive the localizer. `camera`: camera of the images.
  PictureLocalizer(const scene::Scene& scene, const imaging::Camera& camera, const LocalizerOptions& options = {});
  /// Creates a localizer that shares the appearance with another localizer or camera in the same scene.
  PictureLocalizer(const scene::Scene& scene, std::shared_ptr<const render::Appearance> appearance,
                   const imaging::Camera& camera, const LocalizerOptions& options = {});
  ~PictureLocalizer();
  PictureLocalizer(const PictureLocalizer&) = delete;
  PictureLocalizer& operator=(const PictureLocalizer&) = delete;

  /// Locates an image from a guess whose error is below about a twentieth of the image. nullopt if the image does not
  /// match the renderings: wrong place, place not in view, textures of another season. Throws InputError if the image
  /// differs in size from the camera.
  std::optional<LocalizationResult> locate(const imaging::RgbImage& picture,
                                           const geometry::SE3& T_local_camera_guess) const;

  /// Appearance of the scene; share it, since it holds a copy of all textures.
  std::shared_ptr<const render::Appearance> appearance() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tileflight::localization
