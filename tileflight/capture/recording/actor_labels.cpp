#include "tileflight/capture/recording/actor_labels.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <utility>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/strict_section.h"
#include "tileflight/core/geometry/json_numbers.h"

namespace tileflight::recording {
namespace {

using nlohmann::json;

std::string frame_file(std::size_t frame) { return base::formatted("%06zu", frame) + ".json"; }

/// The pixels of an object.
struct Mask {
  int left = 0, top = 0, right = 0, bottom = 0;  ///< the last two excluded
  std::int64_t area = 0;
  std::vector<std::int64_t> counts;  ///< COCO's run lengths: down the columns, of pixels outside and inside in turn
};

/// The masks of all objects in the image, by label.
std::map<std::uint32_t, Mask> masks_of(const imaging::Image<std::uint32_t>& labels) {
  std::map<std::uint32_t, Mask> masks;
  std::map<std::uint32_t, std::int64_t> ends;  // of the last run, in pixels down the columns
  for (int x = 0; x < labels.width; ++x) {
    for (int y = 0; y < labels.height; ++y) {
      const std::uint32_t label = labels(x, y);
      if (label == 0) continue;
      const std::int64_t at = std::int64_t{x} * labels.height + y;
      Mask& mask = masks[label];
      std::int64_t& end = ends[label];
      if (mask.area == 0) {
        mask.left = x;
        mask.top = y;
      }
      if (mask.area > 0 && end == at) {
        ++mask.counts.back();
      } else {
        mask.counts.insert(mask.counts.end(), {at - end, 1});
      }
      end = at + 1;
      mask.top = std::min(mask.top, y);
      mask.right = x + 1;
      mask.bottom = std::max(mask.bottom, y + 1);
      ++mask.area;
    }
  }
  for (auto& [label, mask] : masks) {
    const std::int64_t rest = std::int64_t{labels.width} * labels.height - ends[label];
    if (rest > 0) mask.counts.push_back(rest);
  }
  return masks;
}

json visible_part(const Mask& mask, int width, int height) {
  return {{"bbox", {mask.left, mask.top, mask.right - mask.left, mask.bottom - mask.top}},
          {"area", mask.area},
          {"segmentation", {{"counts", mask.counts}, {"size", {height, width}}}}};
}

json box_of(const scene::Traffic& traffic, std::size_t actor, double time_s, const geometry::SE3& T_local_camera) {
  const scene::ActorState state = traffic.state(actor, time_s);
  const geometry::Box3 own = traffic.own_box(actor);
  const geometry::Vec3 center = state.T_local_actor * own.center();
  const geometry::SE3 T_camera_local = T_local_camera.inverse();
  return {{"actor", traffic.plans()[actor].name},
          {"category", scene::make_model(traffic.plans()[actor].model).name},
          {"center", geometry::json_numbers(center)},
          {"size", geometry::json_numbers(own.sizes())},
          {"rotation", geometry::json_numbers(state.T_local_actor.rotation)},
          {"velocity_m_s", geometry::json_numbers(state.velocity_m_s)},
          {"center_camera", geometry::json_numbers(geometry::Vec3(T_camera_local * center))},
          {"rotation_camera", geometry::json_numbers(T_camera_local.rotation * state.T_local_actor.rotation)}};
}

geometry::Vec3 read_vector(base::StrictSection& box, const char* key) {
  const auto v = box.numbers(key, 3, 3);
  if (!v) throw box.error(key, "is missing");
  return {(*v)[0], (*v)[1], (*v)[2]};
}

Eigen::Quaterniond read_rotation(base::StrictSection& box) {
  const auto v = box.numbers("rotation", 4, 4);
  if (!v) throw box.error("rotation", "is missing");
  const Eigen::Quaterniond rotation((*v)[3], (*v)[0], (*v)[1], (*v)[2]);
  if (std::abs(rotation.norm() - 1.0) > 1e-6) throw box.error("rotation", "must be a unit quaternion");
  return rotation;
}

}  // namespace

bool ActorBox::has_same_place(const ActorBox& other) const {
  return T_local_box.translation == other.T_local_box.translation &&
         T_local_box.rotation.coeffs() == other.T_local_box.rotation.coeffs() && size_m == other.size_m;
}

bool has_actor_boxes(const std::filesystem::path& dataset_folder) {
  return std::filesystem::is_directory(dataset_folder / "boxes");
}

std::vector<ActorBox> read_actor_boxes(const std::filesystem::path& dataset_folder, const std::string& frame_id) {
  const std::filesystem::path file = dataset_folder / "boxes" / (frame_id + ".json");
  const json frame = base::read_json(file);
  base::StrictSection section(frame, file);
  section.require("boxes");
  std::vector<ActorBox> boxes;
  for (base::StrictSection& box : section.sections("boxes")) {
    boxes.push_back(
        {box.required_text("actor"), {read_rotation(box), read_vector(box, "center")}, read_vector(box, "size")});
    if (!(boxes.back().size_m.minCoeff() > 0.0)) throw box.error("size", "must be positive");
  }
  return boxes;
}

ActorLabels::ActorLabels(std::filesystem::path dataset_folder, std::shared_ptr<const scene::Traffic> traffic)
    : folder_(std::move(dataset_folder)), traffic_(std::move(traffic)) {
  if (traffic_) base::make_folder(folder_ / "boxes");
}

void ActorLabels::add(const render::FlightFrame& frame, const geometry::SE3& T_local_camera) const {
  if (!traffic_) return;
  std::map<std::string, std::uint32_t> label_of;
  for (std::size_t i = 0; i < frame.objects.size(); ++i) {
    if (frame.objects[i].is_placed) label_of[frame.objects[i].tile] = static_cast<std::uint32_t>(i + 1);
  }
  const imaging::Image<std::uint32_t>& labels = frame.outputs.objects;
  const std::map<std::uint32_t, Mask> masks = masks_of(labels);
  json boxes = json::array();
  for (std::size_t i = 0; i < traffic_->plans().size(); ++i) {
    json box = box_of(*traffic_, i, frame.time_s, T_local_camera);
    const auto label = label_of.find(traffic_->plans()[i].name);
    const auto mask = label == label_of.end() ? masks.end() : masks.find(label->second);
    if (mask != masks.end()) box["visible"] = visible_part(mask->second, labels.width, labels.height);
    boxes.push_back(std::move(box));
  }
  const json all = {{"frame", frame.index}, {"time_s", frame.time_s}, {"boxes", std::move(boxes)}};
  base::write_file(folder_ / "boxes" / frame_file(frame.index), all.dump() + "\n");
}

void ActorLabels::finish(std::size_t frames, int width, int height, const char* image_ending) const {
  if (!traffic_) return;
  json coco = {{"info", {{"description", "Rendered by tileflight; boxes and masks of the actors' visible pixels"}}},
               {"images", json::array()},
               {"annotations", json::array()},
               {"categories", json::array()}};
  std::map<std::string, std::size_t> category_ids;
  for (const std::string& name : scene::model_names()) {
    category_ids.emplace(name, category_ids.size() + 1);
    coco["categories"].push_back({{"id", category_ids.size()}, {"name", name}});
  }
  for (std::size_t frame = 0; frame < frames; ++frame) {
    const std::string name = base::formatted("%06zu", frame);
    coco["images"].push_back(
        {{"id", frame}, {"file_name", "images/" + name + image_ending}, {"width", width}, {"height", height}});
    const json read = base::read_json(folder_ / "boxes" / frame_file(frame));
    for (std::size_t actor = 0; actor < read["boxes"].size(); ++actor) {
      json box = read["boxes"][actor];
      if (!box.contains("visible")) continue;
      json annotation = std::move(box["visible"]);
      annotation["id"] = coco["annotations"].size() + 1;
      annotation["image_id"] = frame;
      annotation["category_id"] = category_ids.at(box["category"].get<std::string>());
      annotation["iscrowd"] = 0;
      annotation["track_id"] = actor + 1;
      box.erase("visible");
      box.erase("category");
      annotation["box3d"] = std::move(box);
      coco["annotations"].push_back(std::move(annotation));
    }
  }
  base::write_file(folder_ / "coco.json", coco.dump() + "\n");
}

}  // namespace tileflight::recording
