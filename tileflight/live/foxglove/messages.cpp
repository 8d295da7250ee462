#include "tileflight/live/foxglove/messages.h"

#include <bit>
#include <limits>
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

namespace {

const json& member(const json& object, const char* key) {
  const auto at = object.find(key);
  if (at == object.end()) throw ProtocolError(std::string("key \"") + key + "\" is missing");
  return *at;
}

const json& array_member(const json& object, const char* key) {
  const json& found = member(object, key);
  if (!found.is_array()) throw ProtocolError(std::string("\"") + key + "\" is not an array");
  return found;
}

std::uint32_t number_of(const json& value, const char* key) {
  constexpr std::uint64_t kMost = std::numeric_limits<std::uint32_t>::max();
  if (!value.is_number_unsigned() || value.get<std::uint64_t>() > kMost)
    throw ProtocolError(std::string("\"") + key + "\" is not a number from 0 to 4294967295");
  return value.get<std::uint32_t>();
}

std::string text_of(const json& value, const char* key) {
  if (!value.is_string()) throw ProtocolError(std::string("\"") + key + "\" is not a string");
  return value.get<std::string>();
}

std::vector<std::string> names_of(const json& object) {
  std::vector<std::string> names;
  for (const json& name : array_member(object, "parameterNames")) names.push_back(text_of(name, "parameterNames"));
  return names;
}

std::optional<std::string> request_id(const json& object) {
  const auto at = object.find("id");
  if (at == object.end() || at->is_null()) return std::nullopt;
  return text_of(*at, "id");
}

const json& require_object(const json& value, const char* key) {
  if (!value.is_object()) throw ProtocolError(std::string("an entry of \"") + key + "\" is not an object");
  return value;
}

Subscribe subscribe_of(const json& object) {
  Subscribe message;
  for (const json& entry : array_member(object, "subscriptions")) {
    require_object(entry, "subscriptions");
    message.subscriptions.push_back(
        {number_of(member(entry, "id"), "id"), number_of(member(entry, "channelId"), "channelId")});
  }
  return message;
}

Unsubscribe unsubscribe_of(const json& object) {
  Unsubscribe message;
  for (const json& id : array_member(object, "subscriptionIds"))
    message.ids.push_back(number_of(id, "subscriptionIds"));
  return message;
}

ParameterValue parameter_value(const json& value) {
  if (value.is_boolean()) return value.get<bool>();
  if (value.is_number()) return value.get<double>();
  if (value.is_string()) return value.get<std::string>();
  return std::monostate{};
}

SetParameters set_parameters_of(const json& object) {
  SetParameters message;
  for (const json& entry : array_member(object, "parameters")) {
    require_object(entry, "parameters");
    const auto value = entry.find("value");
    message.parameters.push_back(
        {text_of(member(entry, "name"), "name"), value == entry.end() ? ParameterValue{} : parameter_value(*value)});
  }
  message.id = request_id(object);
  return message;
}

}  // namespace

ClientMessage parse_client_message(std::string_view text) {
  const json object = json::parse(text, nullptr, false);
  if (object.is_discarded()) throw ProtocolError("a text message is not JSON");
  if (!object.is_object()) throw ProtocolError("a text message is not a JSON object");
  const std::string op = text_of(member(object, "op"), "op");
  if (op == "subscribe") return subscribe_of(object);
  if (op == "unsubscribe") return unsubscribe_of(object);
  if (op == "getParameters") return GetParameters{names_of(object), request_id(object)};
  if (op == "setParameters") return set_parameters_of(object);
  if (op == "subscribeParameterUpdates") return SubscribeParameters{names_of(object)};
  if (op == "unsubscribeParameterUpdates") return UnsubscribeParameters{names_of(object)};
  return UnsupportedOperation{op};
}

}  // namespace tileflight::foxglove
