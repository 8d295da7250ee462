#include "tileflight/live/simulator/object_labels.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <map>
#include <set>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/random_numbers.h"

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

namespace {

std::array<Rgb8, 256> make_palette() {
  std::array<Rgb8, 256> palette{};
  const std::map<std::size_t, Rgb8> published{
      {0, {0, 0, 0}}, {1, {153, 108, 6}}, {2, {112, 105, 191}}, {7, {115, 176, 195}}};
  std::set<Rgb8> used;
  for (const auto& [id, colour] : published) used.insert(colour);
  std::uint64_t state = 0;
  for (std::size_t id = 0; id < palette.size(); ++id) {
    if (const auto at = published.find(id); at != published.end()) {
      palette[id] = at->second;
      continue;
    }
    Rgb8 colour{};
    do {
      const std::uint64_t bits = base::splitmix64_hash(++state);
      colour = {static_cast<std::uint8_t>(bits), static_cast<std::uint8_t>(bits >> 8U),
                static_cast<std::uint8_t>(bits >> 16U)};
    } while (colour[0] + colour[1] + colour[2] < 120 || !used.insert(colour).second);
    palette[id] = colour;
  }
  return palette;
}

// Colours as numbers of 24 bits. Multiplication by an odd number permutes them (modulo 2^24), so the n-th colour beyond
// the palette is the n-th of this permutation, of which those of the palette are left out.
constexpr std::uint32_t kColourMask = 0xFFFFFFU;
constexpr std::uint32_t kStep = 0x9E3779U;      // odd: near the golden ratio of 2^24, so that neighbours differ
constexpr std::uint32_t kStepBack = 0xB382C9U;  // its inverse modulo 2^24

/// Returns the positions of the palette's colours in the permutation, ascending.
std::array<std::uint32_t, 256> make_palette_positions() {
  std::array<std::uint32_t, 256> positions{};
  std::ranges::transform(segmentation_palette(), positions.begin(),
                         [](const Rgb8& colour) { return (colour_number(colour) * kStepBack) & kColourMask; });
  std::ranges::sort(positions);
  return positions;
}

}  // namespace

Rgb8 segmentation_colour(int id) {
  static const std::array<std::uint32_t, 256> kTaken = make_palette_positions();
  const auto number = static_cast<std::uint32_t>(std::max(id, 0));
  if (number < segmentation_palette().size()) return segmentation_palette()[number];
  auto position = number - static_cast<std::uint32_t>(segmentation_palette().size());
  for (const std::uint32_t taken : kTaken) {
    if (taken <= position) ++position;
  }
  const std::uint32_t colour = (position * kStep) & kColourMask;
  return {static_cast<std::uint8_t>(colour >> 16U), static_cast<std::uint8_t>(colour >> 8U),
          static_cast<std::uint8_t>(colour)};
}

const std::array<Rgb8, 256>& segmentation_palette() {
  static const std::array<Rgb8, 256> kPalette = make_palette();
  return kPalette;
}

int default_segmentation_id(const std::string& name) {
  int sum = 5;
  for (const char c : name) {
    const int code = std::tolower(static_cast<unsigned char>(c));
    if (code >= 97) sum = (sum + code) % 256;
  }
  return sum;
}

bool SegmentationIds::set(const std::string& name, int id, bool is_pattern, const std::vector<std::string>& names) {
  if (id < -1 || id > kMaxSegmentationId)
    throw InputError("segmentation id " + std::to_string(id),
                     "must be from -1 to " + std::to_string(kMaxSegmentationId));
  const std::lock_guard lock(mutex_);
  return rules_.set(name, id, is_pattern, names);
}

int SegmentationIds::find_id(const std::string& name) const {
  return rules_.find(name).value_or(by_names_ ? default_segmentation_id(name) : 0);
}

int SegmentationIds::lookup(const std::string& name) const {
  const std::lock_guard lock(mutex_);
  return find_id(name);
}

std::vector<int> SegmentationIds::lookup(const std::vector<std::string>& names) const {
  const std::lock_guard lock(mutex_);
  std::vector<int> ids;
  ids.reserve(names.size());
  for (const std::string& name : names) ids.push_back(find_id(name));
  return ids;
}

}  // namespace tileflight::simulator
