#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "tileflight/core/base/progress.h"
#include "tileflight/data/dataset/dataset.h"
#include "tileflight/data/dataset/rig.h"
#include "tileflight/data/messages/ros_messages.h"

namespace tileflight::exports {

/// Writes an MCAP file (https://mcap.dev/spec, major version 0): messages in uncompressed chunks of some megabytes,
/// each chunk with its checksum and indexes, and a summary with schemas, channels, chunk indexes and statistics for
/// random access. `file` appears only in finish(). Throws InputError for file system errors and for an existing file
/// unless `replace`.
class McapWriter {
 public:
  /// Begins the file. `profile`: the convention of the messages, "ros2" or "".
  McapWriter(std::filesystem::path file, const std::string& profile, bool replace);
  ~McapWriter();
  McapWriter(const McapWriter&) = delete;
  McapWriter& operator=(const McapWriter&) = delete;

  /// Adds a channel of messages of one type; schemas of the same name are written once. Returns the channel's number.
  std::uint16_t add_channel(const std::string& topic, const std::string& message_encoding,
                            const messages::MessageSchema& schema);

  /// Messages should be added in time order.
  void add_message(std::uint16_t channel, std::int64_t time_ns, std::string_view bytes);

  /// Writes the remaining messages and the summary, and moves the file to its final name.
  void finish();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Result of export_mcap().
struct McapResult {
  std::size_t messages = 0;
  std::vector<std::string> topics;
  std::vector<std::string> notes;  ///< warnings of the dataset, data that is left out, times that are not the dataset's
};

/// Writes the messages of a rig (list_messages with depth and odometry) as one MCAP file in time order. Throws
/// InputError (file, cause), also for an existing file unless `replace`. `epoch_s`: seconds from 1970 to the dataset's
/// time 0; nullopt: 0, or whole seconds such that no message has the time 0, which ROS takes for none (noted).
McapResult export_mcap(const dataset::Rig& rig, const std::filesystem::path& file, bool replace,
                       const Progress& progress = {}, std::optional<double> epoch_s = {});

}  // namespace tileflight::exports
