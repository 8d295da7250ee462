#pragma once

#include <memory>
#include <vector>

#include "tileflight/capture/render/atmosphere.h"
#include "tileflight/capture/render/camera_renderer.h"
#include "tileflight/capture/render/image_formation.h"
#include "tileflight/capture/render/precipitation.h"
#include "tileflight/core/imaging/camera.h"
#include "tileflight/core/imaging/image.h"

namespace tileflight::render {

/// The shutter of one frame: row y of an image of `rows` is open for `open_s` around time_s + (y - (rows - 1) / 2)
/// line_delay_s.
struct StreakShutter {
  PoseFunction pose_at;  ///< T_local_camera; called from one thread
  double time_s = 0.0;
  double open_s = 0.01;
  double line_delay_s = 0.0;
  double weather_offset_s = 0.0;  ///< time on the weather's clock = time_s + this
};

/// Image of a particle that moved while the shutter was open: a rectangle from where it was to where it went.
struct Streak {
  geometry::Vec2 from_px, to_px;  ///< its centre when the shutter opened and closed
  double width_px = 1.0;          ///< of particle and defocus together, at least a pixel
  double opacity = 0.0;           ///< share of the exposure for which it covers a point of the streak
  double depth_m = 0.0;           ///< along the optical axis, at the middle of the exposure
  double distance_m = 0.0;
  LinearRgb light{};
};

/// Returns the length of the rectangle, the particle's own size included, px.
double streak_length_px(const Streak& streak);

/// Draws rain and snow into the light of frames (Garg and Nayar, "Vision and rain", IJCV 75, 2007): each particle of
/// precipitation.h that is near enough to be seen by itself leaves a streak, whose opacity is the share of the exposure
/// for which it covers a point. The area times the opacity is the particle's own area in the image. A drop shows nearly
/// the whole half space behind it, refracted: 0.94 of its mean light (ibid., section 4); a flake is white and matt.
/// Particles too far to change a pixel by 1/255 are part of the air (Atmosphere), as are the farthest of very many.
class StreakRenderer {
 public:
  /// `options`: with weather. `anchor_z_m`: of the scene, as for Atmosphere.
  StreakRenderer(const RenderOptions& options, double anchor_z_m);

  /// Returns the streaks of a frame, in a fixed order.
  std::vector<Streak> streaks(const imaging::Camera& camera, const StreakShutter& shutter) const;
  /// Draws a frame's streaks before its surfaces. `depth_m`: LightFrame::depth_m.
  void draw(const imaging::Camera& camera, const StreakShutter& shutter, const imaging::FloatImage& depth_m,
            LinearImage& light) const;

 private:
  LinearRgb ambient(const geometry::Vec3& normal) const;
  LinearRgb light_of(PrecipitationKind kind, const geometry::Vec3& ray, double height_m, double distance_m) const;

  struct Kind {
    PrecipitationKind kind;
    std::vector<ParticleClass> classes;
  };
  std::vector<Kind> kinds_;
  std::shared_ptr<const Daylight> daylight_;
  double anchor_z_m_;
  Atmosphere air_;
};

}  // namespace tileflight::render
