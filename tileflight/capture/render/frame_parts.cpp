#include "tileflight/capture/render/frame_parts.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cstring>
#include <functional>
#include <stdexcept>
#include <utility>

#include "tileflight/core/base/raw_bytes.h"

namespace tileflight::render {
namespace {

using imaging::PixelRegion;
using Labels = imaging::Image<std::uint32_t>;

/// Calls `work` with each pair of images of two frames.
template <class From, class To, class Work>
void for_each_image(From& from, To& to, const Work& work) {
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

/// The place of a layer's mesh in the order of all the frame's meshes.
std::uint32_t rank_of(const TracedLayer& layer, std::uint32_t mesh, std::span<const std::uint32_t> ranks) {
  constexpr std::uint32_t kFirstPlacedRank = 1U << 31U;
  return mesh < layer.first_placed_mesh ? ranks[mesh] : kFirstPlacedRank + (mesh - layer.first_placed_mesh);
}

/// Takes the layer's surfaces into `nearest` where they are before those there: at the pixels that are 255 in the
/// result.
imaging::GrayImage merge_surfaces(const TracedLayer& layer, std::span<const std::uint32_t> ranks,
                                  imaging::Image<LayerSurface>& nearest) {
  imaging::GrayImage taken(nearest.width, nearest.height);
  tbb::parallel_for(0, nearest.height, [&](int y) {
    for (int x = 0; x < nearest.width; ++x) {
      LayerSurface surface = layer.surfaces(x, y);
      if (surface.mesh != LayerSurface::kNone) surface.mesh = rank_of(layer, surface.mesh, ranks);
      if (!is_before(surface, nearest(x, y))) continue;
      nearest(x, y) = surface;
      taken(x, y) = 255;
    }
  });
  return taken;
}

void append_text(std::string& bytes, const std::string& text) {
  base::append_raw(bytes, static_cast<std::uint64_t>(text.size()));
  bytes += text;
}

/// Reads what was appended, in the same order.
class PackedBytes {
 public:
  explicit PackedBytes(std::string_view bytes) : bytes_(bytes) {}

  std::string_view take(std::size_t size) {
    if (size > bytes_.size()) throw std::logic_error("a packed layer ends early");
    const std::string_view taken = bytes_.substr(0, size);
    bytes_.remove_prefix(size);
    return taken;
  }
  template <class Value>
  Value take() {
    Value value;
    std::memcpy(&value, take(sizeof value).data(), sizeof value);
    return value;
  }
  std::string take_text() { return std::string(take(take<std::uint64_t>())); }
  template <class Value>
  std::vector<Value> take_values(std::size_t count) {
    std::vector<Value> values(count);
    if (count > 0) std::memcpy(values.data(), take(count * sizeof(Value)).data(), count * sizeof(Value));
    return values;
  }

 private:
  std::string_view bytes_;
};

void append_object(std::string& bytes, const SceneObject& object) {
  append_text(bytes, object.tile);
  base::append_raw(bytes, object.mesh);
  base::append_raw(bytes, object.feature);
  append_text(bytes, object.name);
  base::append_raw(bytes, static_cast<std::uint8_t>(object.is_placed ? 1 : 0));
}

SceneObject take_object(PackedBytes& bytes) {
  SceneObject object;
  object.tile = bytes.take_text();
  object.mesh = bytes.take<std::uint32_t>();
  object.feature = bytes.take<std::uint32_t>();
  object.name = bytes.take_text();
  object.is_placed = bytes.take<std::uint8_t>() != 0;
  return object;
}

/// The values of an image at some of its pixels; of an empty image, none.
template <class Pixel>
void append_pixels(std::string& bytes, const imaging::Image<Pixel>& image, const std::vector<std::uint32_t>& at) {
  base::append_raw(bytes, static_cast<std::uint8_t>(image.empty() ? 0 : 1));
  if (image.empty()) return;
  const std::size_t begin = bytes.size();
  bytes.resize(begin + at.size() * sizeof(Pixel));
  char* to = bytes.data() + begin;
  for (const std::uint32_t i : at) {
    std::memcpy(to, &image.pixels[i], sizeof(Pixel));
    to += sizeof(Pixel);
  }
}

}  // namespace

std::uint32_t FrameObjects::label_of(const SceneObject& object) {
  const auto [number, is_new] = numbers_.try_emplace({object.is_placed, object.tile, object.mesh, object.feature},
                                                     static_cast<std::uint32_t>(objects_.size()));
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
  if (is_empty_) {
    frame_ = std::move(part);
    is_empty_ = false;
    return;
  }
  frame_.check.view.add(part.check.view);
  for_each_image(part, frame_, [&](const auto& from, auto& to) { imaging::copy_region(region, from, to); });
}

TracedFrame DividedFrame::take_frame() {
  check_.write_to(frame_.check);
  frame_.objects = objects_.all();
  return std::move(frame_);
}

void LayeredFrame::add(TracedLayer layer, std::span<const std::uint32_t> ranks) {
  const bool is_first = nearest_.empty();
  if (is_first) nearest_ = {layer.surfaces.width, layer.surfaces.height};
  const imaging::GrayImage taken = merge_surfaces(layer, ranks, nearest_);
  Labels& labels = layer.frame.outputs.objects;
  LabelMap label_in_frame(layer.frame.objects, objects_);
  for (std::size_t i = 0; i < labels.pixels.size(); ++i)
    labels.pixels[i] = taken.pixels[i] != 0 ? label_in_frame(labels.pixels[i]) : 0;
  if (is_first) {
    frame_ = std::move(layer.frame);  // of its check's view, the rays count; see view()
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

std::vector<std::uint32_t> LayeredFrame::pixels_with_surface() const {
  std::vector<std::uint32_t> at;
  for (std::size_t i = 0; i < nearest_.pixels.size(); ++i) {
    if (nearest_.pixels[i].mesh != LayerSurface::kNone) at.push_back(static_cast<std::uint32_t>(i));
  }
  return at;
}

std::string LayeredFrame::packed() const {
  std::string bytes;
  base::append_raw(bytes, check_);
  const std::vector<std::uint32_t> at = pixels_with_surface();
  base::append_raw(bytes, static_cast<std::uint64_t>(at.size()));
  if (at.empty()) return bytes;
  bytes.append(reinterpret_cast<const char*>(at.data()), at.size() * sizeof(at[0]));
  base::append_raw(bytes, static_cast<std::uint64_t>(objects_.all().size()));
  for (const SceneObject& object : objects_.all()) append_object(bytes, object);
  append_pixels(bytes, nearest_, at);
  for_each_image(frame_, frame_, [&](const auto& image, const auto&) { append_pixels(bytes, image, at); });
  return bytes;
}

void LayeredFrame::add_packed(std::string_view packed) {
  PackedBytes bytes(packed);
  check_.add(bytes.take<PathCheck>());
  const auto count = bytes.take<std::uint64_t>();
  if (count == 0) return;
  const auto at = bytes.take_values<std::uint32_t>(count);
  if (at.back() >= nearest_.pixels.size()) throw std::logic_error("a packed layer is of a larger image");
  std::vector<SceneObject> objects;
  for (auto left = bytes.take<std::uint64_t>(); left > 0; --left) objects.push_back(take_object(bytes));
  std::vector<std::uint8_t> is_taken(count, 0);
  if (bytes.take<std::uint8_t>() == 0) throw std::logic_error("a packed layer has no surfaces");
  const auto surfaces = bytes.take_values<LayerSurface>(count);
  for (std::size_t k = 0; k < count; ++k) {
    if (!is_before(surfaces[k], nearest_.pixels[at[k]])) continue;
    nearest_.pixels[at[k]] = surfaces[k];
    is_taken[k] = 1;
  }
  for_each_image(frame_, frame_, [&](auto& image, const auto&) {
    using Pixel = typename std::remove_cvref_t<decltype(image.pixels)>::value_type;
    if ((bytes.take<std::uint8_t>() != 0) == image.empty()) throw std::logic_error("a packed layer has other outputs");
    if (image.empty()) return;
    const auto values = bytes.take_values<Pixel>(count);
    for (std::size_t k = 0; k < count; ++k) {
      if (is_taken[k] != 0) image.pixels[at[k]] = values[k];
    }
  });
  LabelMap label_in_frame(objects, objects_);
  Labels& labels = frame_.outputs.objects;
  for (std::size_t k = 0; k < count && !labels.empty(); ++k) {
    if (is_taken[k] != 0) labels.pixels[at[k]] = label_in_frame(labels.pixels[at[k]]);
  }
}

TracedFrame LayeredFrame::take_frame() {
  objects_.keep_shown(frame_.outputs.objects);
  frame_.objects = objects_.all();
  frame_.check.view = view();
  check_.write_to(frame_.check);
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
