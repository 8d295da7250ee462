#include "tileflight/live/simulator/annotation_layers.h"

#include <algorithm>
#include <cmath>

#include "tileflight/core/base/input_error.h"
#include "tileflight/live/simulator/object_labels.h"

namespace tileflight::simulator {
namespace {

using imaging::Rgb8;

constexpr float kWhite = 255.0F;

bool is_byte(int value) { return value >= 0 && value <= 255; }

}  // namespace

AnnotationLayers::AnnotationLayers(const std::vector<AnnotationSettings>& layers) {
  for (const AnnotationSettings& layer : layers) layers_[layer.name].kind = layer.kind;
}

bool AnnotationLayers::set(const std::string& layer, AnnotationKind kind, const std::string& name, const Label& label,
                           bool is_pattern, const std::vector<std::string>& names) {
  const std::lock_guard lock(mutex_);
  const auto at = layers_.find(layer);
  return at != layers_.end() && at->second.kind == kind && at->second.labels.set(name, label, is_pattern, names);
}

bool AnnotationLayers::set_id(const std::string& layer, const std::string& name, int id, bool is_pattern,
                              const std::vector<std::string>& names) {
  if (id < 0 || id > kMaxSegmentationId) return false;
  const Label label{.colour = segmentation_colour(id), .id = id};
  return set(layer, AnnotationKind::kColourIndex, name, label, is_pattern, names);
}

bool AnnotationLayers::set_colour(const std::string& layer, const std::string& name, int red, int green, int blue,
                                  bool is_pattern, const std::vector<std::string>& names) {
  if (!is_byte(red) || !is_byte(green) || !is_byte(blue)) return false;
  const Rgb8 colour{static_cast<std::uint8_t>(red), static_cast<std::uint8_t>(green), static_cast<std::uint8_t>(blue)};
  return set(layer, AnnotationKind::kColour, name, {.colour = colour}, is_pattern, names);
}

bool AnnotationLayers::set_value(const std::string& layer, const std::string& name, float value, bool is_pattern,
                                 const std::vector<std::string>& names) {
  if (!(value >= 0.0F && value <= 1.0F)) return false;
  const auto grey = static_cast<std::uint8_t>(std::lround(value * kWhite));
  const Label label{.colour = {grey, grey, grey}, .value = value};
  return set(layer, AnnotationKind::kGreyscale, name, label, is_pattern, names);
}

std::optional<AnnotationLayers::Label> AnnotationLayers::find(const std::string& layer, AnnotationKind kind,
                                                              const std::string& name) const {
  const std::lock_guard lock(mutex_);
  const auto at = layers_.find(layer);
  if (at == layers_.end() || at->second.kind != kind) return std::nullopt;
  return at->second.labels.find(name);
}

int AnnotationLayers::id(const std::string& layer, const std::string& name) const {
  return find(layer, AnnotationKind::kColourIndex, name).value_or(Label{}).id;
}

std::string AnnotationLayers::colour(const std::string& layer, const std::string& name) const {
  const std::optional<Label> label = find(layer, AnnotationKind::kColour, name);
  if (!label) return {};
  const Rgb8& c = label->colour;
  return std::to_string(c[0]) + "," + std::to_string(c[1]) + "," + std::to_string(c[2]);
}

float AnnotationLayers::value(const std::string& layer, const std::string& name) const {
  return find(layer, AnnotationKind::kGreyscale, name).value_or(Label{}).value;
}

std::vector<Rgb8> AnnotationLayers::colours(const std::string& layer, const std::vector<std::string>& names) const {
  const std::lock_guard lock(mutex_);
  const auto at = layers_.find(layer);
  if (at == layers_.end()) {
    std::string known;
    for (const auto& [name, unused] : layers_) known += (known.empty() ? "" : ", ") + name;
    throw InputError("annotation layer '" + layer.substr(0, 100) + "'",
                     known.empty() ? "does not exist; the settings have none (Annotation)"
                                   : "does not exist; the layers are: " + known);
  }
  std::vector<Rgb8> colours;
  for (const std::string& name : names) colours.push_back(at->second.labels.find(name).value_or(Label{}).colour);
  return colours;
}

}  // namespace tileflight::simulator
