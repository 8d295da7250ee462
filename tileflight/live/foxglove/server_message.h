#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "tileflight/live/foxglove/channel.h"

namespace tileflight::foxglove {

// What the server sends (Foxglove WebSocket protocol v1): JSON texts, and binary messages of which these are the heads.

/// Server Info: `name`, the capabilities parameters, parametersSubscribe and time, and a session id by which a client
/// tells a new server from a reconnection.
std::string server_info_text(const std::string& name, const std::string& session_id);

/// Level of a status, with the protocol's numbers.
enum class StatusLevel : int { kInfo = 0, kWarning = 1, kError = 2 };
std::string status_text(StatusLevel level, const std::string& message);

std::string advertise_text(const std::vector<std::pair<ChannelId, Channel>>& channels);
std::string unadvertise_text(const std::vector<ChannelId>& channels);

/// Parameter Values; `id` is that of the request.
std::string parameter_values_text(const std::vector<Parameter>& parameters, const std::optional<std::string>& id);

/// Head of a Message Data: opcode 1, subscription (uint32), time in nanoseconds (uint64), little-endian; the message's
/// own bytes follow.
std::string message_data_head(std::uint32_t subscription, std::uint64_t time_ns);

/// A Time message: opcode 2, time in nanoseconds (uint64), little-endian.
std::string time_message(std::uint64_t time_ns);

}  // namespace tileflight::foxglove
