// Record names and opcodes are those of https://mcap.dev/spec; all numbers are little-endian.
#include "tileflight/data/exports/mcap.h"

#include <zlib.h>

#include <bit>
#include <cassert>
#include <cmath>
#include <fstream>
#include <limits>
#include <map>
#include <vector>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/data/exports/layout_writers.h"
#include "tileflight/data/messages/dataset_messages.h"
#include "tileflight/data/messages/ros_messages.h"

namespace tileflight::exports {

namespace {

namespace fs = std::filesystem;

static_assert(std::endian::native == std::endian::little);

constexpr std::string_view kMagic("\x89MCAP0\r\n", 8);
constexpr std::size_t kChunkBytes = std::size_t{4} << 20;

enum class Opcode : std::uint8_t {
  kHeader = 0x01,
  kFooter = 0x02,
  kSchema = 0x03,
  kChannel = 0x04,
  kMessage = 0x05,
  kChunk = 0x06,
  kMessageIndex = 0x07,
  kChunkIndex = 0x08,
  kStatistics = 0x0B,
  kSummaryOffset = 0x0E,
  kDataEnd = 0x0F,
};

/// Builds the content of a record, field by field.
class RecordBuilder {
 public:
  template <class Number>
  RecordBuilder& number(Number value) {
    bytes_.append(reinterpret_cast<const char*>(&value), sizeof value);
    return *this;
  }
  RecordBuilder& text(std::string_view value) {
    number(static_cast<std::uint32_t>(value.size()));
    return raw(value);
  }
  RecordBuilder& raw(std::string_view value) {
    bytes_.append(value);
    return *this;
  }
  /// A map or an array: its length in bytes, then its entries.
  template <class First, class Second, class Entries>
  RecordBuilder& pairs(const Entries& entries) {
    number(static_cast<std::uint32_t>(entries.size() * (sizeof(First) + sizeof(Second))));
    for (const auto& [first, second] : entries) number<First>(first).template number<Second>(second);
    return *this;
  }
  const std::string& bytes() const { return bytes_; }

 private:
  std::string bytes_;
};

std::string make_record(Opcode op, std::string_view content) {
  RecordBuilder head;
  head.number(op).number(static_cast<std::uint64_t>(content.size()));
  return head.bytes() + std::string(content);
}
std::string make_record(Opcode op, const RecordBuilder& content) { return make_record(op, content.bytes()); }

std::uint32_t checksum(std::uint32_t before, std::string_view bytes) {
  return static_cast<std::uint32_t>(crc32_z(before, reinterpret_cast<const Bytef*>(bytes.data()), bytes.size()));
}

struct TimeRange {
  std::uint64_t first = std::numeric_limits<std::uint64_t>::max(), last = 0;

  void add(std::uint64_t time) {
    first = std::min(first, time);
    last = std::max(last, time);
  }
  std::uint64_t begin() const { return first <= last ? first : 0; }
};

}  // namespace

struct McapWriter::Impl {
  fs::path target, temporary;
  std::ofstream stream;
  std::uint64_t written = 0;
  bool finished = false;

  std::map<std::string, std::uint16_t> schema_ids;
  std::string schemas, channels;  ///< their records, repeated in the summary
  std::uint32_t channel_count = 0;
  std::map<std::uint16_t, std::uint64_t> message_counts;
  TimeRange times;

  std::string chunk;
  TimeRange chunk_times;
  std::map<std::uint16_t, std::vector<std::pair<std::uint64_t, std::uint64_t>>> chunk_index;  ///< time, offset
  std::string chunk_indexes;
  std::uint32_t chunk_count = 0;

  void put(std::string_view bytes) {
    stream.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    if (!stream) throw InputError(target.string(), "cannot be written: no space left, or a write error");
    written += bytes.size();
  }

  /// Writes the chunk and an index for each of its channels; their offsets go into the summary.
  void flush() {
    if (chunk.empty()) return;
    const std::uint64_t chunk_start = written;
    RecordBuilder fields;
    fields.number(chunk_times.begin()).number(chunk_times.last).number(static_cast<std::uint64_t>(chunk.size()));
    fields.number(checksum(0, chunk)).text("").number(static_cast<std::uint64_t>(chunk.size())).raw(chunk);
    put(make_record(Opcode::kChunk, fields));
    const std::uint64_t chunk_length = written - chunk_start, indexes_start = written;
    std::map<std::uint16_t, std::uint64_t> offsets;
    for (const auto& [channel, entries] : chunk_index) {
      offsets[channel] = written;
      put(make_record(Opcode::kMessageIndex,
                      RecordBuilder().number(channel).pairs<std::uint64_t, std::uint64_t>(entries)));
    }
    RecordBuilder index;
    index.number(chunk_times.begin()).number(chunk_times.last).number(chunk_start).number(chunk_length);
    index.pairs<std::uint16_t, std::uint64_t>(offsets).number(written - indexes_start).text("");
    index.number(static_cast<std::uint64_t>(chunk.size())).number(static_cast<std::uint64_t>(chunk.size()));
    chunk_indexes += make_record(Opcode::kChunkIndex, index);
    ++chunk_count;
    chunk.clear();
    chunk_times = {};
    chunk_index.clear();
  }

  std::string statistics() const {
    std::uint64_t messages = 0;
    for (const auto& [channel, count] : message_counts) messages += count;
    RecordBuilder fields;
    fields.number(messages).number(static_cast<std::uint16_t>(schema_ids.size())).number(channel_count);
    fields.number(std::uint32_t{0}).number(std::uint32_t{0}).number(chunk_count);
    fields.number(times.begin()).number(times.last).pairs<std::uint16_t, std::uint64_t>(message_counts);
    return make_record(Opcode::kStatistics, fields);
  }

  /// Writes groups of records and their offsets; the checksum covers everything up to the footer's own.
  void put_summary() {
    const std::uint64_t summary_start = written;
    std::string summary, offsets;
    for (const auto& [op, group] : {std::pair{Opcode::kSchema, schemas},
                                    {Opcode::kChannel, channels},
                                    {Opcode::kStatistics, statistics()},
                                    {Opcode::kChunkIndex, chunk_indexes}}) {
      if (group.empty()) continue;
      offsets += make_record(Opcode::kSummaryOffset, RecordBuilder()
                                                         .number(op)
                                                         .number(summary_start + summary.size())
                                                         .number(static_cast<std::uint64_t>(group.size())));
      summary += group;
    }
    const std::uint64_t offsets_start = summary_start + summary.size();
    constexpr std::uint64_t kFooterBytes = 8 + 8 + 4;
    RecordBuilder footer;
    footer.number(Opcode::kFooter).number(kFooterBytes).number(summary_start).number(offsets_start);
    summary += offsets + footer.bytes();
    put(summary);
    put(RecordBuilder().number(checksum(0, summary)).bytes());
  }
};

McapWriter::McapWriter(fs::path file, const std::string& profile, bool replace) : impl_(std::make_unique<Impl>()) {
  if (fs::exists(file) && !replace) throw InputError(file.string(), "exists already; --force replaces it");
  if (fs::is_directory(file)) throw InputError(file.string(), "is a folder; choose a file name");
  impl_->target = fs::absolute(file).lexically_normal();
  std::error_code ignored;
  fs::create_directories(impl_->target.parent_path(), ignored);
  impl_->temporary = base::make_temporary_path(impl_->target);
  impl_->stream.open(impl_->temporary, std::ios::binary);
  impl_->put(kMagic);
  impl_->put(make_record(Opcode::kHeader, RecordBuilder().text(profile).text("tileflight")));
}

McapWriter::~McapWriter() {
  std::error_code ignored;
  if (!impl_->finished) fs::remove(impl_->temporary, ignored);
}

std::uint16_t McapWriter::add_channel(const std::string& topic, const std::string& message_encoding,
                                      const messages::MessageSchema& schema) {
  const auto next_schema = static_cast<std::uint16_t>(impl_->schema_ids.size() + 1);  // 0 means "without schema"
  const auto [known, is_new] = impl_->schema_ids.emplace(schema.name, next_schema);
  std::string records;
  if (is_new) {
    records = make_record(
        Opcode::kSchema, RecordBuilder().number(next_schema).text(schema.name).text(schema.encoding).text(schema.text));
    impl_->schemas += records;
  }
  const auto channel = static_cast<std::uint16_t>(impl_->channel_count++);
  const std::string declared = make_record(Opcode::kChannel, RecordBuilder()
                                                                 .number(channel)
                                                                 .number(known->second)
                                                                 .text(topic)
                                                                 .text(message_encoding)
                                                                 .number(std::uint32_t{0}));
  impl_->channels += declared;
  impl_->chunk += records + declared;
  return channel;
}

void McapWriter::add_message(std::uint16_t channel, std::int64_t time_ns, std::string_view bytes) {
  assert(channel < impl_->channel_count);
  const auto time = static_cast<std::uint64_t>(std::max<std::int64_t>(0, time_ns));
  const auto sequence = static_cast<std::uint32_t>(impl_->message_counts[channel]++);
  impl_->chunk_index[channel].emplace_back(time, impl_->chunk.size());
  impl_->chunk += make_record(Opcode::kMessage,
                              RecordBuilder().number(channel).number(sequence).number(time).number(time).raw(bytes));
  impl_->times.add(time);
  impl_->chunk_times.add(time);
  if (impl_->chunk.size() >= kChunkBytes) impl_->flush();
}

void McapWriter::finish() {
  impl_->flush();
  impl_->put(make_record(Opcode::kDataEnd,
                         RecordBuilder().number(std::uint32_t{0})));  // 0: no checksum over the whole data section
  impl_->put_summary();
  impl_->put(kMagic);
  impl_->stream.close();
  if (!impl_->stream) throw InputError(impl_->target.string(), "cannot be written: no space left, or a write error");
  std::error_code error;
  fs::rename(impl_->temporary, impl_->target, error);
  if (error) throw InputError(impl_->target.string(), "cannot be written: " + error.message());
  impl_->finished = true;
}

McapResult export_mcap(const dataset::Rig& rig, const std::filesystem::path& file, bool replace,
                       const Progress& progress, std::optional<double> epoch_s) {
  const messages::DatasetMessages recording =
      messages::list_messages(rig, {.depth = true, .odometry = true, .epoch_s = epoch_s});
  McapResult result;
  note_reading_warnings(rig, result.notes);
  base::add_distinct(recording.notes, result.notes);
  note_data_left_out(rig, {"depth", "lidar", "imu.csv", "gps.csv", "barometer.csv", "magnetometer.csv", "range.csv"},
                     result.notes);
  McapWriter writer(file, "ros2", replace);
  result.messages = recording.messages.size();
  std::vector<std::uint16_t> channels;
  for (const messages::MessageTopic& topic : recording.topics) {
    channels.push_back(writer.add_channel(topic.name, "cdr", messages::ros::schema(topic.type)));
    result.topics.push_back(topic.name);
  }
  std::int64_t done = 0;
  for (const messages::DatasetMessage& message : recording.messages) {
    writer.add_message(channels[message.topic], message.time_ns, message.make());
    report_progress(progress, ++done, static_cast<std::int64_t>(result.messages), "writing messages");
  }
  writer.finish();
  return result;
}

}  // namespace tileflight::exports
