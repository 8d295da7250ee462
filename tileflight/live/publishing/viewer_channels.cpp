#include "tileflight/live/publishing/viewer_channels.h"

#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "tileflight/core/base/raw_bytes.h"
#include "tileflight/core/drawing/html.h"
#include "tileflight/data/messages/ros_messages.h"

namespace tileflight::publishing {
namespace {

using nlohmann::json;

constexpr std::uint64_t kSecond_ns = 1000000000;

json number_fields(std::initializer_list<const char*> names) {
  json properties;
  for (const char* name : names) properties[name] = {{"type", "number"}};
  return {{"type", "object"}, {"properties", properties}};
}

json vector_schema() { return number_fields({"x", "y", "z"}); }

json object_schema(const json& properties) { return {{"type", "object"}, {"properties", properties}}; }

json array_schema(const json& items) { return {{"type", "array"}, {"items", items}}; }

/// The parts of Foxglove's schema that are used (https://docs.foxglove.dev/docs/sdk/schemas/scene-update): time stamps
/// and durations are objects of sec and nsec, bytes are base64.
json scene_update_schema() {
  const json text = {{"type", "string"}};
  const json time = object_schema({{"sec", {{"type", "integer"}}}, {"nsec", {{"type", "integer"}}}});
  const json pose =
      object_schema({{"position", vector_schema()}, {"orientation", number_fields({"x", "y", "z", "w"})}});
  const json model = object_schema({{"pose", pose},
                                    {"scale", vector_schema()},
                                    {"color", number_fields({"r", "g", "b", "a"})},
                                    {"override_color", {{"type", "boolean"}}},
                                    {"url", text},
                                    {"media_type", text},
                                    {"data", {{"type", "string"}, {"contentEncoding", "base64"}}}});
  const json entity = object_schema({{"timestamp", time},
                                     {"frame_id", text},
                                     {"id", text},
                                     {"lifetime", time},
                                     {"frame_locked", {{"type", "boolean"}}},
                                     {"metadata", array_schema(object_schema({{"key", text}, {"value", text}}))},
                                     {"models", array_schema(model)}});
  json schema = object_schema({{"deletions", array_schema(object_schema({}))}, {"entities", array_schema(entity)}});
  schema["title"] = "foxglove.SceneUpdate";
  return schema;
}

json time_json(std::uint64_t time_ns) { return {{"sec", time_ns / kSecond_ns}, {"nsec", time_ns % kSecond_ns}}; }

json vector_json(const geometry::Vec3& v) { return {{"x", v.x()}, {"y", v.y()}, {"z", v.z()}}; }

double degrees_of(double radians) { return radians * 180.0 / std::numbers::pi; }

}  // namespace

foxglove::Channel ros_channel(const std::string& topic, const std::string& type, bool is_latched) {
  const messages::MessageSchema schema = messages::ros::schema(type);
  return {topic, "cdr", schema.name, schema.encoding, schema.text, is_latched};
}

foxglove::Channel scene_channel(const std::string& topic) {
  return {topic, "json", "foxglove.SceneUpdate", "jsonschema", scene_update_schema().dump(), true};
}

/// A lifetime of zero means for ever.
std::string scene_update(const std::string& glb, const std::string& frame_id, std::uint64_t time_ns,
                         const std::vector<std::string>& attribution) {
  json metadata = json::array();
  for (const std::string& line : attribution) metadata.push_back({{"key", "attribution"}, {"value", line}});
  const json model = {
      {"pose",
       {{"position", vector_json(geometry::Vec3::Zero())}, {"orientation", {{"x", 0}, {"y", 0}, {"z", 0}, {"w", 1}}}}},
      {"scale", vector_json(geometry::Vec3::Ones())},
      {"color", {{"r", 1}, {"g", 1}, {"b", 1}, {"a", 1}}},
      {"override_color", false},
      {"url", ""},
      {"media_type", "model/gltf-binary"},
      {"data", base::base64(glb)}};
  const json entity = {{"timestamp", time_json(time_ns)},
                       {"frame_id", frame_id},
                       {"id", "place"},
                       {"lifetime", time_json(0)},
                       {"frame_locked", true},
                       {"metadata", metadata},
                       {"models", {model}}};
  const json update = {{"deletions", json::array()}, {"entities", {entity}}};
  return update.dump(-1, ' ', false, json::error_handler_t::replace);
}

foxglove::Channel motion_channel(const std::string& topic) {
  json schema = object_schema({{"position", vector_schema()},
                               {"velocity", vector_schema()},
                               {"angular_velocity", vector_schema()},
                               {"attitude_deg", number_fields({"roll", "pitch", "heading"})},
                               {"speed", {{"type", "number"}}}});
  schema["title"] = "tileflight.Motion";
  return {topic, "json", "tileflight.Motion", "jsonschema", schema.dump()};
}

std::string motion_text(const Motion& motion) {
  const geometry::Mat3 R = motion.T_local_body.rotation.toRotationMatrix();
  const json attitude = {{"roll", degrees_of(std::atan2(R(2, 1), R(2, 2)))},
                         {"pitch", degrees_of(std::asin(std::clamp(R(2, 0), -1.0, 1.0)))},
                         {"heading", degrees_of(std::atan2(R(0, 0), R(1, 0)))}};
  return json{{"position", vector_json(motion.T_local_body.translation)},
              {"velocity", vector_json(motion.T_local_body.rotation * motion.velocity_m_s)},
              {"angular_velocity", vector_json(motion.angular_velocity_rad_s)},
              {"attitude_deg", attitude},
              {"speed", motion.velocity_m_s.norm()}}
      .dump();
}

}  // namespace tileflight::publishing
