#pragma once

// Localization of an image by direct alignment with renderings of the textured place. It does not use the map's points,
// so it is independent evidence for an alignment made from them.

namespace tileflight::render {
class Appearance;  // appearance.h
}

#include <memory>
#include <optional>
#include <vector>

#include "tileflight/core/imaging/camera.h"
#include "tileflight/core/imaging/image.h"
#include "tileflight/evaluation/registration/located_poses.h"
#include "tileflight/slam/tracking/tracking_reference.h"
#include "tileflight/world/scene/scene.h"

namespace tileflight::localization {

/// Normalises local contrast: subtracts the local mean and divides by the local standard deviation over a square window
/// of 2 reach + 1 pixels (clipped at the borders), then scales to mean 128 and standard deviation 40. This removes
/// lighting, exposure, vignetting and texture tone that vary over more than the window. `least_deviation` is added to
/// the local deviation, so that noise in uniform areas stays small.
imaging::FloatImage normalize_local_contrast(const imaging::FloatImage& image, int reach, float least_deviation = 4.0F);

using Mat6 = Eigen::Matrix<double, 6, 6>;

struct LocalizerOptions {
  int width = 960;     ///< images are downscaled to at most this width, pixels
  int points = 2500;   ///< selected high-gradient pixels of the rendered image
  int max_rounds = 4;  ///< maximum number of renderings, each from the pose found by the last round
  /// Sides of the windows of local contrast normalisation, as shares of the width. The wide one finds an image from a
  /// poor guess; what has changed in the place (shadows, leaves, wear) is wide, and the narrow one removes it.
  double wide_window = 0.1, narrow_window = 0.02;
  double min_share_in_view = 0.15;  ///< smallest share of the rendered points in view
  double min_correlation = 0.35;    ///< of rendered and observed grey values at the points
};

struct LocalizationResult {
  geometry::SE3 T_local_camera;
  /// Information matrix of a small motion x of the camera in its own axes, T_local_camera exp(x), translation (m)
  /// first, rotation (rad): inverse of the covariance due to pixel noise.
  Mat6 information = Mat6::Zero();
  /// Covariance of the same motion from how the parts of the image contradict each other: the errors of pixels are
  /// independent between the cells of a grid, not within one. It holds where textures have changed, too.
  Mat6 covariance = Mat6::Identity();
  std::vector<registration::PosePart> parts;  ///< of those cells; their squares sum up to nearly the covariance
  double correlation = 0.0;                   ///< of rendered and observed grey values at the points
  double share_in_view = 0.0;
  double rmse = 0.0;  ///< after contrast normalisation, grey values
};

/// A rendering of the place, with the points that images taken near it are aligned by.
struct RenderedView {
  geometry::SE3 T_local_camera;
  tracking::TrackingReference reference;
  double window = 0.0;  ///< of its local contrast normalisation, as a share of the width
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

  /// Looks at another scene from now on: other tiles of the same place. The scene must outlive the localizer, or the
  /// next call.
  void use(const scene::Scene& scene, std::shared_ptr<const render::Appearance> appearance);

  /// Locates an image from a guess whose error is below about a twentieth of the image: with the wide window, then with
  /// the narrow one. nullopt if the image does not match the renderings: wrong place, place not in view. The result's
  /// correlation is that with the wide window. Throws InputError if the image differs in size from the camera.
  std::optional<LocalizationResult> locate(const imaging::RgbImage& picture,
                                           const geometry::SE3& T_local_camera_guess) const;

  /// Renders the place from a pose, for several images taken near it, with one of the options' windows. Returns null if
  /// it shows too little texture.
  std::shared_ptr<const RenderedView> render_view(const geometry::SE3& T_local_camera, double window) const;
  /// Returns how far the image moves between two poses near a view, as a share of the image's width (root mean square
  /// over the view's points).
  double image_motion(const RenderedView& view, const geometry::SE3& T_local_from,
                      const geometry::SE3& T_local_to) const;
  /// Locates an image by a view from near it, without rendering. With the narrow window the guess must be better than
  /// for locate(): its error below about a fiftieth of the image.
  std::optional<LocalizationResult> align(const imaging::RgbImage& picture, const RenderedView& view,
                                          const geometry::SE3& T_local_camera_guess) const;

  const LocalizerOptions& options() const;

  /// Appearance of the scene; share it, since it holds a copy of all textures.
  std::shared_ptr<const render::Appearance> appearance() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tileflight::localization
