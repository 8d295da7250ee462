#pragma once

#include <map>
#include <mutex>
#include <string>
#include <vector>

#include "tileflight/core/imaging/image.h"
#include "tileflight/live/simulator/name_rules.h"

namespace tileflight::simulator {

/// What an annotation layer holds for each object (Cosys-AirSim's types 0, 1, 2, and its two modes of colours).
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

  // Set the label of all matching objects, including those of tiles loaded later (NameRules::set(), whose errors they
  // throw). False, and nothing is set: no object matches, there is no such layer, it is of another kind, or the label
  // is out of range.
  bool set_id(const std::string& layer, const std::string& name, int id, bool is_pattern,
              const std::vector<std::string>& names);
  bool set_colour(const std::string& layer, const std::string& name, int red, int green, int blue, bool is_pattern,
                  const std::vector<std::string>& names);
  bool set_value(const std::string& layer, const std::string& name, float value, bool is_pattern,
                 const std::vector<std::string>& names);

  // The label of an object; what Cosys-AirSim answers where the layer is missing or of another kind.
  int id(const std::string& layer, const std::string& name) const;              ///< -1: none
  std::string colour(const std::string& layer, const std::string& name) const;  ///< "R,G,B"; empty: none
  float value(const std::string& layer, const std::string& name) const;         ///< 0: none

  bool has(const std::string& layer) const { return layers_.contains(layer); }
  /// The colour in which each object is shown. Throws InputError, naming the layers, if there is no such layer.
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

}  // namespace tileflight::simulator
