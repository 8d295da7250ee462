#include "tileflight/live/foxglove/client_session.h"

#include <algorithm>
#include <utility>

#include "tileflight/core/base/input_error.h"

namespace tileflight::foxglove {
namespace {

/// Limit of the answers that wait for a client, without those at the start.
constexpr std::size_t kMaxAnswerBytes = std::size_t{4} << 20U;
constexpr std::size_t kShownCharacters = 100;  ///< of what a client names

}  // namespace

ClientSession::ClientSession(const std::string& server_name, const std::string& session_id, const Channels& channels,
                             const ParameterAccess& parameters, const QueueLimits& limits)
    : channels_(channels), parameters_(parameters), queue_(limits) {
  answers_.push_back(server_info_text(server_name, session_id));
  std::vector<std::pair<ChannelId, Channel>> all;
  for (const auto& [id, open] : channels_) all.emplace_back(id, open.channel);
  answers_.push_back(advertise_text(all));
}

std::vector<std::string> ClientSession::receive(std::string_view text) {
  set_parameters_.clear();
  std::visit([this](const auto& message) { handle(message); }, parse_client_message(text));
  return std::exchange(set_parameters_, {});
}

void ClientSession::answer(std::string text) {
  answer_bytes_ += text.size();
  if (answer_bytes_ > kMaxAnswerBytes) throw ProtocolError("asks and does not read the answers");
  answers_.push_back(std::move(text));
}

void ClientSession::send_status(StatusLevel level, const std::string& text) { answer(status_text(level, text)); }

void ClientSession::advertise(ChannelId id, const Channel& channel) {
  answers_.push_back(advertise_text({{id, channel}}));
}

void ClientSession::unadvertise(ChannelId id) {
  subscriptions_.erase(id);
  queue_.forget(id);
  answers_.push_back(unadvertise_text({id}));
}

void ClientSession::offer(const QueuedMessage& message, bool is_latched, std::size_t max_bytes) {
  if (!is_subscribed(message.channel)) return;
  if (is_latched) {
    queue_.push_latched(message);
  } else {
    queue_.push(message, max_bytes);
  }
}

void ClientSession::offer_parameters(const std::vector<Parameter>& parameters) {
  std::vector<Parameter> wanted;
  std::ranges::copy_if(parameters, std::back_inserter(wanted),
                       [this](const Parameter& one) { return watched_parameters_.contains(one.name); });
  if (!wanted.empty()) answer(parameter_values_text(wanted, std::nullopt));
}

std::optional<OutgoingMessage> ClientSession::next() {
  if (!answers_.empty()) {
    OutgoingMessage message{true, std::move(answers_.front()), nullptr};
    answers_.pop_front();
    if (answers_.empty()) answer_bytes_ = 0;
    return message;
  }
  if (time_ns_) return OutgoingMessage{false, time_message(*std::exchange(time_ns_, std::nullopt)), nullptr};
  if (auto message = queue_.pop())
    return OutgoingMessage{false, message_data_head(subscriptions_.at(message->channel), message->time_ns),
                           std::move(message->bytes)};
  return std::nullopt;
}

void ClientSession::handle(const Subscribe& message) {
  for (const Subscription& wanted : message.subscriptions) subscribe(wanted);
}

/// A client has one subscription for each channel at a time, each with an id of its own.
void ClientSession::subscribe(const Subscription& wanted) {
  const StatusLevel error = StatusLevel::kError;
  const auto channel = channels_.find(wanted.channel);
  if (channel == channels_.end())
    return send_status(error, "subscribe: there is no channel " + std::to_string(wanted.channel));
  if (is_subscribed(wanted.channel))
    return send_status(error, "subscribe: channel " + std::to_string(wanted.channel) + " is subscribed to already");
  const auto same_id = [&](const auto& one) { return one.second == wanted.id; };
  if (std::ranges::any_of(subscriptions_, same_id))
    return send_status(error, "subscribe: id " + std::to_string(wanted.id) + " is in use");
  subscriptions_.emplace(wanted.channel, wanted.id);
  const OpenChannel& open = channel->second;
  if (open.last) queue_.push_latched({wanted.channel, open.time_ns, open.last});
}

void ClientSession::handle(const Unsubscribe& message) {
  for (const std::uint32_t id : message.ids) {
    const auto at = std::ranges::find(subscriptions_, id, [](const auto& one) { return one.second; });
    if (at == subscriptions_.end()) {
      send_status(StatusLevel::kWarning, "unsubscribe: there is no id " + std::to_string(id));
      continue;
    }
    queue_.forget(at->first);
    subscriptions_.erase(at);
  }
}

std::vector<Parameter> ClientSession::named_parameters(const std::vector<std::string>& names) const {
  std::vector<Parameter> all = parameters_.read();
  if (names.empty()) return all;
  std::erase_if(all, [&](const Parameter& one) { return std::ranges::find(names, one.name) == names.end(); });
  return all;
}

void ClientSession::handle(const GetParameters& message) {
  answer(parameter_values_text(named_parameters(message.names), message.id));
}

void ClientSession::handle(const SetParameters& message) {
  std::vector<std::string> names;
  for (const Parameter& wanted : message.parameters) {
    names.push_back(wanted.name);
    try {
      if (!parameters_.write) throw InputError(wanted.name.substr(0, kShownCharacters), "cannot be set here");
      parameters_.write(wanted);
      set_parameters_.push_back(wanted.name);
    } catch (const InputError& error) {
      send_status(StatusLevel::kError, error.what());
    }
  }
  if (message.id && !names.empty()) answer(parameter_values_text(named_parameters(names), message.id));
}

void ClientSession::handle(const SubscribeParameters& message) {
  for (const Parameter& one : named_parameters(message.names)) watched_parameters_.insert(one.name);
}

void ClientSession::handle(const UnsubscribeParameters& message) {
  if (message.names.empty()) watched_parameters_.clear();
  for (const std::string& name : message.names) watched_parameters_.erase(name);
}

void ClientSession::handle(const UnsupportedOperation& message) {
  send_status(StatusLevel::kWarning, "operation " + message.op.substr(0, kShownCharacters) + " is not supported here");
}

}  // namespace tileflight::foxglove
