#include "tileflight/live/simulator/frames.h"
#include "tileflight/live/simulator/simulator_impl.h"

// Calls that Cosys-AirSim adds to AirSim's, about objects of the scene.
namespace tileflight::simulator {

std::vector<std::array<std::string, 2>> Simulator::sim_list_scene_objects_tags(const std::string& name_regex) {
  std::vector<std::array<std::string, 2>> tags;
  for (std::string& name : sim_list_scene_objects(name_regex)) tags.push_back({std::move(name), std::string()});
  return tags;
}

std::vector<std::string> Simulator::sim_list_instance_segmentation_objects() { return sim_list_scene_objects(".*"); }

std::vector<Pose> Simulator::sim_list_instance_segmentation_poses(bool /*ned*/, bool /*only_visible*/) {
  const auto place = impl_->place_now();
  if (!place->has_surface()) return {};
  std::map<std::string, geometry::Box3> bounds;  // in the order of the names
  for (std::size_t i = 0; i < place->object_names().size(); ++i)
    bounds[place->object_names()[i]].extend(place->object_bounds()[i]);
  const geometry::SE3 T_ned_local = impl_->T_local_ned.inverse();
  std::vector<Pose> poses;
  for (const auto& [name, box] : bounds)
    poses.push_back(to_airsim(geometry::SE3(Eigen::Quaterniond::Identity(), T_ned_local * box.center())));
  return poses;
}

std::vector<Vector3r> Simulator::sim_get_instance_segmentation_color_map() const {
  std::vector<Vector3r> colours;
  for (const imaging::Rgb8& c : simulator::segmentation_palette())
    colours.push_back({static_cast<float>(c[0]), static_cast<float>(c[1]), static_cast<float>(c[2])});
  return colours;
}

std::vector<std::string> Simulator::sim_list_annotation_objects(const std::string& layer) {
  return impl_->annotation_layers.has(layer) ? sim_list_scene_objects(".*") : std::vector<std::string>();
}

std::vector<Pose> Simulator::sim_list_annotation_poses(const std::string& layer, bool ned, bool only_visible) {
  return impl_->annotation_layers.has(layer) ? sim_list_instance_segmentation_poses(ned, only_visible)
                                             : std::vector<Pose>();
}

bool Simulator::sim_set_annotation_object_id(const std::string& layer, const std::string& name, int id,
                                             bool is_name_regex) {
  return impl_->annotation_layers.set_id(layer, name, id, is_name_regex, sim_list_scene_objects(".*"));
}

int Simulator::sim_get_annotation_object_id(const std::string& layer, const std::string& name) const {
  return impl_->annotation_layers.id(layer, name);
}

bool Simulator::sim_set_annotation_object_color(const std::string& layer, const std::string& name, int red, int green,
                                                int blue, bool is_name_regex) {
  return impl_->annotation_layers.set_colour(layer, name, red, green, blue, is_name_regex,
                                             sim_list_scene_objects(".*"));
}

std::string Simulator::sim_get_annotation_object_color(const std::string& layer, const std::string& name) const {
  return impl_->annotation_layers.colour(layer, name);
}

bool Simulator::sim_set_annotation_object_value(const std::string& layer, const std::string& name, float value,
                                                bool is_name_regex) {
  return impl_->annotation_layers.set_value(layer, name, value, is_name_regex, sim_list_scene_objects(".*"));
}

float Simulator::sim_get_annotation_object_value(const std::string& layer, const std::string& name) const {
  return impl_->annotation_layers.value(layer, name);
}

}  // namespace tileflight::simulator
