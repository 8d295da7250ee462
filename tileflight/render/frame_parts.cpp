#include "tileflight/render/frame_parts.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <functional>
#include <utility>

namespace tileflight::render {
namespace {

using imaging::PixelRegion;
using Labels = imaging::Image<std::uint32_t>;

/// Calls `work` with each pair of images of two frames.
template <class Frame, class Work>
void for_each_image(Frame& from, TracedFrame& to, const Work& work) {
  work(from.rgb, to.rgb);
  work(from.light, to.light);
  work(from.depth_m, to.depth_m);
  work(from.outputs.range_m, to.outputs.range_m);
  work(from.outputs.normals, to.outputs.normals);
  work(from.outputs.objects, to.outputs.objects);
  work(from.outputs.flow_px, to.outputs.flow_px);
  work(from.outputs.visibility, to.outputs.visibility);
}

/// The labels of a part's objects in the whole frame, each found when it is first met.
class LabelMap {
 public:
  LabelMap(std::span<const SceneObject> part, FrameObjects& whole) : part_(part), whole_(whole), labels_(part.size()) {}
  std::uint32_t operator()(std::uint32_t label) {
    if (label == 0) return 0;
    std::uint32_t& known = labels_[label - 1];
    if (known == 0) known = whole_.label_of(part_[label - 1]);
    return known;
  }

 private:
  std::span<const SceneObject> part_;
  FrameObjects& whole_;
  std::vector<std::uint32_t> labels_;
};

/// Whether the surface `a` is seen before `b`; `mesh` of both: its rank.
bool is_before(const LayerSurface& a, const LayerSurface& b) {
  if (a.mesh == LayerSurface::kNone) return false;
  if (b.mesh == LayerSurface::kNone) return true;
  return a.nearness > b.nearness || (a.nearness == b.nearness && a.mesh < b.mesh);
}

/// Takes the layer's surfaces into `nearest` where they are before those there: at the pixels that are 255 in the
/// result.
imaging::GrayImage merge_surfaces(const imaging::Image<LayerSurface>& layer, std::span<const std::uint32_t> ranks,
                                  imaging::Image<LayerSurface>& nearest) {
  imaging::GrayImage taken(layer.width, layer.height);
  tbb::parallel_for(0, layer.height, [&](int y) {
    for (int x = 0; x < layer.width; ++x) {
      LayerSurface surface = layer(x, y);
      if (surface.mesh != LayerSurface::kNone) surface.mesh = ranks[surface.mesh];
      if (!is_before(surface, nearest(x, y))) continue;
      nearest(x, y) = surface;
      taken(x, y) = 255;
    }
  });
  return taken;
}

}  // namespace

std::uint32_t FrameObjects::label_of(const SceneObject& object) {
  const auto [number, is_new] =
      numbers_.try_emplace({object.tile, object.mesh, object.feature}, static_cast<std::uint32_t>(objects_.size()));
  if (is_new) objects_.push_back(object);
  return number->second + 1;
}

void FrameObjects::keep_shown(Labels& labels) {
  if (labels.empty()) return;
  std::vector<std::uint32_t> label_of(objects_.size() + 1, 0);
  for (const std::uint32_t label : labels.pixels) label_of[label] = label;
  std::vector<SceneObject> shown;
  for (std::size_t label = 1; label < label_of.size(); ++label) {
    if (label_of[label] == 0) continue;
    shown.push_back(std::move(objects_[label - 1]));
    label_of[label] = static_cast<std::uint32_t>(shown.size());
  }
  label_of[0] = 0;
  for (std::uint32_t& label : labels.pixels) label = label_of[label];
  objects_ = std::move(shown);
  numbers_.clear();
}

void DividedFrame::add(const PixelRegion& region, TracedFrame part) {
  Labels& labels = part.outputs.objects;
  LabelMap label_in_frame(part.objects, objects_);
  for (int y = region.y0; !labels.empty() && y < region.y1; ++y)
    std::transform(labels.row(y) + region.x0, labels.row(y) + region.x1, labels.row(y) + region.x0,
                   std::ref(label_in_frame));
  frame_.check.view.add(part.check.view);
  if (is_empty_) {
    part.check = frame_.check;
    frame_ = std::move(part);
    is_empty_ = false;
    return;
  }
  for_each_image(part, frame_, [&](const auto& from, auto& to) { imaging::copy_region(region, from, to); });
}

TracedFrame DividedFrame::take_frame() {
  frame_.objects = objects_.all();
  return std::move(frame_);
}

void LayeredFrame::add(TracedLayer layer, std::span<const std::uint32_t> ranks) {
  const bool is_first = nearest_.empty();
  if (is_first) nearest_ = {layer.surfaces.width, layer.surfaces.height};
  const imaging::GrayImage taken = merge_surfaces(layer.surfaces, ranks, nearest_);
  Labels& labels = layer.frame.outputs.objects;
  LabelMap label_in_frame(layer.frame.objects, objects_);
  for (std::size_t i = 0; i < labels.pixels.size(); ++i)
    labels.pixels[i] = taken.pixels[i] != 0 ? label_in_frame(labels.pixels[i]) : 0;
  if (is_first) {
    frame_.check.view = layer.frame.check.view;  // of which the rays count; see view()
    layer.frame.check = frame_.check;
    frame_ = std::move(layer.frame);
    return;
  }
  for_each_image(layer.frame, frame_, [&](const auto& from, auto& to) {
    if (from.empty()) return;
    tbb::parallel_for(0, taken.height, [&](int y) {
      for (int x = 0; x < taken.width; ++x) {
        if (taken(x, y) != 0) to(x, y) = from(x, y);
      }
    });
  });
}

TracedFrame LayeredFrame::take_frame() {
  objects_.keep_shown(frame_.outputs.objects);
  frame_.objects = objects_.all();
  frame_.check.view = view();
  return std::move(frame_);
}

ViewStatistics LayeredFrame::view() const {
  ViewStatistics view;
  view.rays = frame_.check.view.rays;
  for (const LayerSurface& surface : nearest_.pixels) {
    if (surface.mesh == LayerSurface::kNone) continue;
    view.surfaces += 1;
    view.back_faces += surface.is_back_face ? 1 : 0;
    view.nearest_m = std::min(view.nearest_m, static_cast<double>(surface.distance_m));
  }
  return view;
}

}  // namespace tileflight::render
