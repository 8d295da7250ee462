#pragma once

#include <list>
#include <memory>
#include <mutex>
#include <optional>
#include <vector>

#include "tileflight/imaging/camera.h"
#include "tileflight/sensors/render.h"
#include "tileflight/simulator/place.h"
#include "tileflight/simulator/segmentation_ids.h"

namespace tileflight::simulator {

/// What clients get where there is no surface: the largest number that AirSim's depth can hold, metres.
inline constexpr float kSkyDistance_m = 65504.0F;
/// Between the two cameras of the pair that disparity is about.
inline constexpr double kStereoBase_m = 0.25;

/// A picture that is to be taken: everything is known, nothing refers to the simulator's state.
struct Shot {
  imaging::Camera lens;
  geometry::SE3 T_local_camera;                 ///< of pictures: x right, y down, z forward
  std::optional<geometry::SE3> T_local_before;  ///< where the camera was in the picture before, for optical flow
};

/// All that the picture's central rays tell, as far as it is asked for; else empty.
struct Layers {
  imaging::RgbImage rgb;
  imaging::FloatImage depth_m;                         ///< along the axis; kSkyDistance_m where there is nothing
  imaging::FloatImage range_m;                         ///< along the ray
  imaging::Image<std::array<float, 3>> normals_local;  ///< unit, of the side that is seen; zero where there is nothing
  imaging::Image<std::uint32_t> objects;               ///< 1 + index into Place::objects(); 0 where there is nothing
  imaging::Image<std::array<float, 2>> flow_px;        ///< from the picture before; zero where there is none
};

/// The layers that a picture of this kind is made of.
struct WantedLayers {
  bool rgb = false, depth = false, range = false, normals = false, objects = false, flow = false;

  void add(ImageType type);
  bool geometry() const { return depth || range || normals || objects || flow; }
};

/// Renders, and keeps what cameras need from one picture to the next. Thread-safe; several pictures may be rendered at
/// once.
class PictureRenderer {
 public:
  /// One pass over the pixels' rays for colour, one for all that is geometry.
  Layers render(const std::shared_ptr<const Place>& place, const Shot& shot, const WantedLayers& wanted);
  /// The renderer of a lens.
  std::shared_ptr<const sensors::CameraRenderer> renderer(const std::shared_ptr<const Place>& place,
                                                          const imaging::Camera& lens);

 private:
  struct Kept {
    std::vector<double> lens;  ///< lens_key()
    std::shared_ptr<const Place> place;
    std::shared_ptr<const sensors::CameraRenderer> renderer;
  };

  std::mutex mutex_;
  std::list<Kept> kept_;  ///< the latest first
};

/// All numbers of a lens: equal lenses have equal keys.
std::vector<double> lens_key(const imaging::Camera& lens);

/// Of each entry of Layers::objects, index 0 being that of nothing, the segmentation id.
std::vector<int> ids_of(const Place& place, const SegmentationIds& ids);

/// A kind of picture as numbers a pixel, row by row from the top (what AirSim has in its red channel).
std::vector<float> float_pixels(ImageType type, const Layers& layers, const imaging::Camera& lens,
                                const std::vector<int>& ids);
/// As colours.
imaging::RgbImage colour_pixels(ImageType type, const Layers& layers, const imaging::Camera& lens,
                                const std::vector<int>& ids);

}  // namespace tileflight::simulator
