#include "tileflight/live/simulator/labels.h"

#include <map>

#include "tileflight/core/base/text_parsing.h"
#include "tileflight/live/simulator/frames.h"
#include "tileflight/live/simulator/world.h"

namespace tileflight::simulator {

bool Labels::set_segmentation_object_id(const std::string& mesh_name, int object_id, bool is_name_regex) {
  return world_.segmentation_ids.set(mesh_name, object_id, is_name_regex, world_.place_now()->distinct_names());
}

int Labels::get_segmentation_object_id(const std::string& mesh_name) {
  const std::string searched = base::to_lower(mesh_name);
  for (const std::string& name : world_.place_now()->distinct_names()) {
    if (base::to_lower(name) == searched) return world_.segmentation_ids.lookup(name);
  }
  return -1;
}

std::vector<std::string> Labels::list_instance_segmentation_objects() { return world_.place_now()->distinct_names(); }

std::vector<Pose> Labels::list_instance_segmentation_poses(bool /*ned*/, bool /*only_visible*/) {
  const auto place = world_.place_now();
  if (!place->has_surface()) return {};
  std::map<std::string, geometry::Box3> bounds;  // in the order of the names
  for (std::size_t i = 0; i < place->object_names().size(); ++i)
    bounds[place->object_names()[i]].extend(place->object_bounds()[i]);
  const geometry::SE3 T_ned_local = world_.T_local_ned.inverse();
  std::vector<Pose> poses;
  for (const auto& [name, box] : bounds)
    poses.push_back(to_airsim(geometry::SE3(Eigen::Quaterniond::Identity(), T_ned_local * box.center())));
  return poses;
}

std::vector<Vector3r> Labels::get_instance_segmentation_color_map() const {
  std::vector<Vector3r> colours;
  for (const imaging::Rgb8& c : segmentation_palette())
    colours.push_back({static_cast<float>(c[0]), static_cast<float>(c[1]), static_cast<float>(c[2])});
  return colours;
}

std::vector<std::string> Labels::list_annotation_objects(const std::string& layer) {
  return world_.annotation_layers.has(layer) ? world_.place_now()->distinct_names() : std::vector<std::string>();
}

std::vector<Pose> Labels::list_annotation_poses(const std::string& layer, bool ned, bool only_visible) {
  return world_.annotation_layers.has(layer) ? list_instance_segmentation_poses(ned, only_visible)
                                             : std::vector<Pose>();
}

bool Labels::set_annotation_object_id(const std::string& layer, const std::string& name, int id, bool is_name_regex) {
  return world_.annotation_layers.set_id(layer, name, id, is_name_regex, world_.place_now()->distinct_names());
}

int Labels::get_annotation_object_id(const std::string& layer, const std::string& name) const {
  return world_.annotation_layers.id(layer, name);
}

bool Labels::set_annotation_object_color(const std::string& layer, const std::string& name, int red, int green,
                                         int blue, bool is_name_regex) {
  return world_.annotation_layers.set_colour(layer, name, red, green, blue, is_name_regex,
                                             world_.place_now()->distinct_names());
}

std::string Labels::get_annotation_object_color(const std::string& layer, const std::string& name) const {
  return world_.annotation_layers.colour(layer, name);
}

bool Labels::set_annotation_object_value(const std::string& layer, const std::string& name, float value,
                                         bool is_name_regex) {
  return world_.annotation_layers.set_value(layer, name, value, is_name_regex, world_.place_now()->distinct_names());
}

float Labels::get_annotation_object_value(const std::string& layer, const std::string& name) const {
  return world_.annotation_layers.value(layer, name);
}

}  // namespace tileflight::simulator
