#pragma once

#include <cstdint>
#include <optional>

#include "tileflight/imaging/camera.h"
#include "tileflight/imaging/image.h"
#include "tileflight/scene/scene.h"

namespace tileflight::sensors {

struct RenderOptions {
  bool depth = true;
  int samples_per_pixel = 1;                     ///< n x n stratified grid for n^2 samples: 1, 4, 9, 16
  imaging::Rgb8 background{135, 180, 225};       ///< where no surface is (sky)
};

struct RenderedFrame {
  imaging::RgbImage rgb;
  imaging::FloatImage depth_m;  ///< along the optical axis; +infinity where nothing is hit, NaN outside the lens's valid cone
};

/// One frame by casting each pixel's own ray, textured, unlit. Texture reads are filtered by the ray's footprint (mip levels, trilinear), so that
/// frames do not shimmer. Same bytes for any thread count.
class CameraRenderer {
 public:
  CameraRenderer(const scene::Scene& scene, imaging::Camera camera, RenderOptions options);
  ~CameraRenderer();
  CameraRenderer(const CameraRenderer&) = delete;
  CameraRenderer& operator=(const CameraRenderer&) = delete;
  RenderedFrame render(const geometry::SE3& T_local_camera) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tileflight::sensors
