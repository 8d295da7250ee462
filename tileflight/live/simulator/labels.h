#pragma once

#include <string>
#include <vector>

#include "tileflight/live/simulator/airsim_types.h"

namespace tileflight::simulator {

struct World;

/// Segmentation ids and annotation layers of objects (see SegmentationIds and AnnotationLayers). Lists hold what is in
/// memory, whatever `only_visible` says. Poses are global NED, whatever `ned` says: there is no other world frame.
class Labels {
 public:
  explicit Labels(World& world) : world_(world) {}

  /// Sets the id of all objects with a name or matching a pattern. Returns whether there are any.
  bool set_segmentation_object_id(const std::string& mesh_name, int object_id, bool is_name_regex);
  /// Returns the id of an object, whose name is compared without regard to case; -1 for an unknown name.
  int get_segmentation_object_id(const std::string& mesh_name);
  std::vector<std::string> list_instance_segmentation_objects();
  /// Returns the centres of the objects in the order of list_instance_segmentation_objects().
  std::vector<Pose> list_instance_segmentation_poses(bool ned, bool only_visible);
  /// Returns red, green and blue (0 to 255) for each id from 0 to 255.
  std::vector<Vector3r> get_instance_segmentation_color_map() const;

  // Annotation layers. An unknown layer has no objects.
  std::vector<std::string> list_annotation_objects(const std::string& layer);
  std::vector<Pose> list_annotation_poses(const std::string& layer, bool ned, bool only_visible);
  bool set_annotation_object_id(const std::string& layer, const std::string& name, int id, bool is_name_regex);
  int get_annotation_object_id(const std::string& layer, const std::string& name) const;
  bool set_annotation_object_color(const std::string& layer, const std::string& name, int red, int green, int blue,
                                   bool is_name_regex);
  std::string get_annotation_object_color(const std::string& layer, const std::string& name) const;
  bool set_annotation_object_value(const std::string& layer, const std::string& name, float value, bool is_name_regex);
  float get_annotation_object_value(const std::string& layer, const std::string& name) const;

 private:
  World& world_;
};

}  // namespace tileflight::simulator
