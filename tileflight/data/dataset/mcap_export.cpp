#include "tileflight/data/dataset/mcap_export.h"

#include "tileflight/data/dataset/dataset_messages.h"
#include "tileflight/data/dataset/mcap_writer.h"
#include "tileflight/data/dataset/ros_messages.h"

namespace tileflight::dataset {

namespace {

McapResult write_messages(const DatasetMessages& recording, const std::filesystem::path& file, bool replace,
                          const Progress& progress) {
  McapWriter writer(file, "ros2", replace);
  McapResult result{recording.messages.size(), {}};
  std::vector<std::uint16_t> channels;
  for (const MessageTopic& topic : recording.topics) {
    channels.push_back(writer.add_channel(topic.name, "cdr", ros::schema(topic.type)));
    result.topics.push_back(topic.name);
  }
  std::int64_t done = 0;
  for (const DatasetMessage& message : recording.messages) {
    writer.add_message(channels[message.topic], message.time_ns, message.make());
    report_progress(progress, ++done, static_cast<std::int64_t>(result.messages), "writing messages");
  }
  writer.finish();
  return result;
}

}  // namespace

McapResult export_mcap(const Dataset& dataset, const std::filesystem::path& file, bool replace,
                       const Progress& progress) {
  return write_messages(list_messages(dataset), file, replace, progress);
}

McapResult export_mcap(const Rig& rig, const std::filesystem::path& file, bool replace, const Progress& progress) {
  return write_messages(list_messages(rig), file, replace, progress);
}

}  // namespace tileflight::dataset
