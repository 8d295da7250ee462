#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <tuple>
#include <vector>

#include "tileflight/capture/render/frame_renderer.h"
#include "tileflight/capture/render/scene_objects.h"
#include "tileflight/core/imaging/image.h"

// Frames of a place that does not fit into memory: each is traced in several scenes that hold some of its tiles.
namespace tileflight::render {

/// The objects of a frame whose scenes number them differently.
class FrameObjects {
 public:
  /// The object's label in the frame: 1 + its index.
  std::uint32_t label_of(const SceneObject& object);
  std::span<const SceneObject> all() const { return objects_; }
  /// Drops objects that the image does not show, and numbers the others anew.
  void keep_shown(imaging::Image<std::uint32_t>& labels);

 private:
  using Key = std::tuple<bool, std::string, std::uint32_t, std::uint32_t>;  ///< is placed, tile, mesh, feature

  std::vector<SceneObject> objects_;
  std::map<Key, std::uint32_t> numbers_;  ///< index into objects_
};

/// A frame whose regions are traced in several scenes, each with the tiles that its region shows.
class DividedFrame {
 public:
  /// Takes the region's pixels; the part's other pixels are ignored. Regions must not overlap.
  void add(const imaging::PixelRegion& region, TracedFrame part);
  /// Adds what a scene with some of the place's surfaces tells of the camera's path.
  void add_check(const PathCheck& check) { check_.add(check); }
  /// The frame, once regions that cover it were added. Its objects live as long as this.
  TracedFrame take_frame();

 private:
  bool is_empty_ = true;
  TracedFrame frame_;
  PathCheck check_;
  FrameObjects objects_;
};

/// A frame that is traced whole in several scenes, each with some of the tiles that it shows, one of them with what is
/// placed there: every pixel is of the nearest surface of all. The scenes must have one anchor.
class LayeredFrame {
 public:
  /// Takes the pixels that are nearer than those of the layers before. `ranks`: of the layer's meshes, their places in
  /// the order of all the frame's meshes, below 2^31, since of equally near surfaces that of the first mesh is shown;
  /// meshes of placed parts follow all others.
  void add(TracedLayer layer, std::span<const std::uint32_t> ranks);
  /// Adds what a scene with some of the place's surfaces tells of the camera's path.
  void add_check(const PathCheck& check) { check_.add(check); }
  /// What the layers and checks so far show, for another process that has others of the frame: the pixels at which
  /// there is a surface, and the checks' sum.
  std::string packed() const;
  /// Takes such pixels that are nearer than those of the layers before, and the checks. Precondition: a layer was
  /// added, of the same image with the same outputs. Throws std::logic_error if the bytes are none of packed().
  void add_packed(std::string_view bytes);
  /// The frame, once all layers were added. Its objects live as long as this.
  TracedFrame take_frame();

 private:
  ViewStatistics view() const;
  std::vector<std::uint32_t> pixels_with_surface() const;

  TracedFrame frame_;
  PathCheck check_;
  imaging::Image<LayerSurface> nearest_;  ///< `mesh`: its rank
  FrameObjects objects_;
};

}  // namespace tileflight::render
