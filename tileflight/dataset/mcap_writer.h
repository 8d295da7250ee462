#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>

namespace tileflight::dataset {

/// Writes an MCAP file (https://mcap.dev/spec, major version 0): messages in chunks of some megabytes without
/// compression, each chunk with its checksum and indexes, and a summary with schemas, channels, chunk indexes and
/// statistics, so that readers may jump. Nothing is at `file` until finish(). Throws InputError for what the file
/// system says and for an existing file unless `replace`.
class McapWriter {
 public:
  /// `profile`: what the messages are by convention, "ros2" or "".
  McapWriter(std::filesystem::path file, const std::string& profile, bool replace);
  ~McapWriter();
  McapWriter(const McapWriter&) = delete;
  McapWriter& operator=(const McapWriter&) = delete;

  struct Schema {
    std::string name;      ///< "sensor_msgs/msg/Imu"
    std::string encoding;  ///< of the text: "ros2msg"
    std::string text;
  };
  /// A channel of messages of one kind; schemas of the same name are written once. Returns its number.
  std::uint16_t add_channel(const std::string& topic, const std::string& message_encoding, const Schema& schema);

  /// Messages should come in the order of their times.
  void add_message(std::uint16_t channel, std::int64_t time_ns, std::string_view bytes);

  /// Writes what is left and the summary, and puts the file in its place.
  void finish();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tileflight::dataset
