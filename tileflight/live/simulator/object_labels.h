#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/imaging/image.h"
#include "tileflight/live/simulator/object_names.h"

namespace tileflight::simulator {

/// Values that clients set for objects by name or by pattern, also for objects that come later. The latest rule that
/// matches a name wins. Not thread-safe.
template <class Value>
class NameRules {
 public:
  /// Sets the value of a whole name or of all names that match a case-insensitive pattern. Returns whether any of
  /// `names` matched; a whole name that is not among them sets nothing. Throws InputError for an invalid pattern, or
  /// more than 10000 patterns.
  bool set(const std::string& name, const Value& value, bool is_pattern, const std::vector<std::string>& names) {
    if (!is_pattern) {
      if (std::ranges::find(names, name) == names.end()) return false;
      by_name_.insert_or_assign(name, value);
      return true;
    }
    auto pattern = std::make_shared<const NamePattern>(name, NamePattern::Case::kIgnored);
    std::erase_if(patterns_, [&](const Rule& rule) { return rule.text == name; });
    if (patterns_.size() >= kMaxPatterns)
      throw InputError("names", "more than " + std::to_string(kMaxPatterns) + " patterns");
    std::erase_if(by_name_, [&](const auto& entry) { return pattern->matches(entry.first); });
    const bool any = std::ranges::any_of(names, [&](const std::string& known) { return pattern->matches(known); });
    patterns_.push_back({name, std::move(pattern), value});
    return any;
  }

  /// Returns the value of a name; nullopt if none was set.
  std::optional<Value> find(const std::string& name) const {
    if (const auto at = by_name_.find(name); at != by_name_.end()) return at->second;
    for (auto rule = patterns_.rbegin(); rule != patterns_.rend(); ++rule) {
      if (rule->pattern->matches(name)) return rule->value;
    }
    return std::nullopt;
  }

 private:
  static constexpr std::size_t kMaxPatterns = 10000;

  struct Rule {
    std::string text;
    std::shared_ptr<const NamePattern> pattern;
    Value value;
  };

  std::vector<Rule> patterns_;            ///< in the order in which they were set
  std::map<std::string, Value> by_name_;  ///< later than all patterns that match
};

/// The kind of label of an annotation layer (Cosys-AirSim's types 0, 1, 2, and its two modes of colours).
enum class AnnotationKind { kColour, kColourIndex, kGreyscale, kTexture };

/// An annotation layer of the settings (Cosys-AirSim's key `Annotation`).
struct AnnotationSettings {
  std::string name;
  AnnotationKind kind = AnnotationKind::kColour;
};

/// Cosys-AirSim's annotation layers: labels that clients give to objects beside the segmentation, each layer shown by
/// images of type Annotation. Objects without a label are black. Layers of textures exist, but nothing can be set in
/// them. Thread-safe.
class AnnotationLayers {
 public:
  explicit AnnotationLayers(const std::vector<AnnotationSettings>& layers);

  // These set the label of all matching objects, including those of tiles loaded later. They return false and set
  // nothing if no object matches, there is no such layer, it is of another kind, or the label is out of range. They
  // throw the errors of NameRules::set().
  bool set_id(const std::string& layer, const std::string& name, int id, bool is_pattern,
              const std::vector<std::string>& names);
  bool set_colour(const std::string& layer, const std::string& name, int red, int green, int blue, bool is_pattern,
                  const std::vector<std::string>& names);
  bool set_value(const std::string& layer, const std::string& name, float value, bool is_pattern,
                 const std::vector<std::string>& names);

  // These return the label of an object, or what Cosys-AirSim answers if the layer is missing or of another kind.
  int id(const std::string& layer, const std::string& name) const;              ///< -1: none
  std::string colour(const std::string& layer, const std::string& name) const;  ///< "R,G,B"; empty: none
  float value(const std::string& layer, const std::string& name) const;         ///< 0: none

  bool has(const std::string& layer) const { return layers_.contains(layer); }
  /// Returns the colour of each object. Throws InputError, which names the layers, if there is no such layer.
  std::vector<imaging::Rgb8> colours(const std::string& layer, const std::vector<std::string>& names) const;

 private:
  struct Label {
    imaging::Rgb8 colour{};
    int id = -1;
    float value = 0.0F;
  };
  struct Layer {
    AnnotationKind kind = AnnotationKind::kColour;
    NameRules<Label> labels;
  };

  bool set(const std::string& layer, AnnotationKind kind, const std::string& name, const Label& label, bool is_pattern,
           const std::vector<std::string>& names);
  std::optional<Label> find(const std::string& layer, AnnotationKind kind, const std::string& name) const;

  mutable std::mutex mutex_;
  std::map<std::string, Layer> layers_;
};

/// The largest id: as many as Cosys-AirSim has colours. AirSim's scripts use those up to 255.
inline constexpr int kMaxSegmentationId = 2'743'999;

/// The colours of the segmentation ids up to 255: AirSim's for 0, 1, 2 and 7, our own for the others; all distinct.
const std::array<imaging::Rgb8, 256>& segmentation_palette();

/// Returns the colour of an id: from the palette, else one that no other id has; black for -1.
imaging::Rgb8 segmentation_colour(int id);
/// Packs a colour into one number: red, green, blue from the highest byte down.
inline std::uint32_t colour_number(const imaging::Rgb8& colour) {
  return (std::uint32_t{colour[0]} << 16U) | (std::uint32_t{colour[1]} << 8U) | colour[2];
}

/// Computes AirSim's default id of an object: (5 + the sum of the ASCII codes of the letters, and of the ASCII
/// characters that follow them, in its lower-cased name) modulo 256.
int default_segmentation_id(const std::string& name);

/// Assigns segmentation ids to object names. Thread-safe.
class SegmentationIds {
 public:
  /// `by_names`: default ids are computed from the names; otherwise all are 0.
  explicit SegmentationIds(bool by_names) : by_names_(by_names) {}

  /// Sets the id of names as NameRules::set() does, including those of tiles loaded later. Throws InputError also for
  /// an id outside -1 to kMaxSegmentationId.
  bool set(const std::string& name, int id, bool is_pattern, const std::vector<std::string>& names);
  int lookup(const std::string& name) const;
  /// Looks up many names efficiently.
  std::vector<int> lookup(const std::vector<std::string>& names) const;

 private:
  int find_id(const std::string& name) const;

  bool by_names_;
  mutable std::mutex mutex_;
  NameRules<int> rules_;
};

}  // namespace tileflight::simulator
