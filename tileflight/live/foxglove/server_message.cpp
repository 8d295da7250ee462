#include "tileflight/live/foxglove/server_message.h"

#include <bit>
#include <nlohmann/json.hpp>

namespace tileflight::foxglove {
namespace {

using nlohmann::json;

constexpr char kMessageData = 1, kTime = 2;  // opcodes

/// Text of clients and files may hold anything: what is not UTF-8 is replaced.
std::string dumped(const json& object) { return object.dump(-1, ' ', false, json::error_handler_t::replace); }

template <class Number>
void append_number(std::string& bytes, Number value) {
  static_assert(std::endian::native == std::endian::little);
  bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
}

json value_json(const ParameterValue& value) {
  if (const auto* truth = std::get_if<bool>(&value)) return *truth;
  if (const auto* number = std::get_if<double>(&value)) return *number;
  if (const auto* text = std::get_if<std::string>(&value)) return *text;
  return nullptr;
}

/// A double is marked as one: 2.0 is written as 2.0, but JavaScript reads it as an integer.
json parameter_json(const Parameter& parameter) {
  json entry = {{"name", parameter.name}, {"value", value_json(parameter.value)}};
  if (std::holds_alternative<double>(parameter.value)) entry["type"] = "float64";
  return entry;
}

}  // namespace

std::string server_info_text(const std::string& name, const std::string& session_id) {
  return dumped({{"op", "serverInfo"},
                 {"name", name},
                 {"capabilities", {"parameters", "parametersSubscribe", "time"}},
                 {"metadata", json::object()},
                 {"sessionId", session_id}});
}

std::string status_text(StatusLevel level, const std::string& message) {
  return dumped({{"op", "status"}, {"level", static_cast<int>(level)}, {"message", message}});
}

std::string advertise_text(const std::vector<std::pair<ChannelId, Channel>>& channels) {
  json entries = json::array();
  for (const auto& [id, channel] : channels)
    entries.push_back({{"id", id},
                       {"topic", channel.topic},
                       {"encoding", channel.encoding},
                       {"schemaName", channel.schema_name},
                       {"schema", channel.schema},
                       {"schemaEncoding", channel.schema_encoding}});
  return dumped({{"op", "advertise"}, {"channels", entries}});
}

std::string unadvertise_text(const std::vector<ChannelId>& channels) {
  return dumped({{"op", "unadvertise"}, {"channelIds", channels}});
}

std::string parameter_values_text(const std::vector<Parameter>& parameters, const std::optional<std::string>& id) {
  json entries = json::array();
  for (const Parameter& parameter : parameters) entries.push_back(parameter_json(parameter));
  json object = {{"op", "parameterValues"}, {"parameters", entries}};
  if (id) object["id"] = *id;
  return dumped(object);
}

std::string message_data_head(std::uint32_t subscription, std::uint64_t time_ns) {
  std::string bytes(1, kMessageData);
  append_number(bytes, subscription);
  append_number(bytes, time_ns);
  return bytes;
}

std::string time_message(std::uint64_t time_ns) {
  std::string bytes(1, kTime);
  append_number(bytes, time_ns);
  return bytes;
}

}  // namespace tileflight::foxglove
