#include "tileflight/live/airsim/session_file.h"

#include <algorithm>
#include <cmath>
#include <span>

#include "tileflight/core/base/hash.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/live/rpc/codec.h"
#include "tileflight/live/rpc/message_scanner.h"

namespace tileflight::airsim {
namespace {

using simulator::AutopilotEvent;
using Values = std::span<const msgpack::object>;

constexpr const char* kFormat = "tileflight session";
constexpr std::uint64_t kVersion = 1;
/// A record is `[kind, number, [values…]]`; the number is that of the call in calls and answers, that of the message in
/// events, else 0.
enum RecordKind : std::uint64_t { kHeader = 0, kCall = 1, kAnswer = 2, kEvent = 3, kLevel = 4, kEnd = 5 };
/// A message of a client has at most a gigabyte.
constexpr std::size_t kMaxRecordBytes = (std::size_t{1} << 30U) + 4096, kChunkBytes = 1U << 16U;
constexpr std::size_t kMaxOutputs = 64;

rpc::Encoder begin_record(RecordKind kind, std::uint64_t number, std::size_t values) {
  rpc::Encoder out;
  out.array(3);
  out.unsigned_integer(kind);
  out.unsigned_integer(number);
  out.array(values);
  return out;
}

void put_blob(rpc::Encoder& out, std::string_view bytes) {
  out.binary({reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()});
}

std::string encoded(const SessionHeader& header) {
  rpc::Encoder out = begin_record(kHeader, 0, 7);
  out.text(kFormat);
  out.unsigned_integer(kVersion);
  for (const std::string* text : {&header.program, &header.source, &header.settings, &header.world})
    put_blob(out, *text);
  out.unsigned_integer(header.start_ns);
  return out.take();
}

std::string encoded(const RecordedCall& call) {
  rpc::Encoder out = begin_record(kCall, call.number, 3);
  out.unsigned_integer(call.client);
  out.signed_integer(call.tick);
  put_blob(out, call.message);
  return out.take();
}

std::string encoded(const RecordedAnswer& answer) {
  rpc::Encoder out = begin_record(kAnswer, answer.call, 3);
  out.binary(answer.hash);
  out.boolean(answer.failed);
  out.signed_integer(answer.tick);
  return out.take();
}

std::string encoded(const RecordedEvent& record) {
  const AutopilotEvent& event = record.event;
  rpc::Encoder out = begin_record(kEvent, event.number, 7);
  out.unsigned_integer(static_cast<std::uint64_t>(event.kind));
  out.text(event.vehicle);
  out.signed_integer(event.tick);
  out.float64(event.time_s);
  out.float64(event.step_s);
  out.array(event.outputs.size());
  for (const double output : event.outputs) out.float64(output);
  event.kind == AutopilotEvent::Kind::kSensors ? out.binary(record.hash) : out.nil();
  return out.take();
}

std::string encoded(const RecordedLevel& level) {
  rpc::Encoder out = begin_record(kLevel, 0, 1);
  out.unsigned_integer(level.start_ns);
  return out.take();
}

std::string encoded(const RecordedEnd& end) {
  rpc::Encoder out = begin_record(kEnd, 0, 1);
  out.signed_integer(end.tick);
  return out.take();
}

template <class T>
T value_at(Values values, std::size_t i) {
  if (i >= values.size()) throw rpc::DecodeError("a value is missing");
  T result{};
  rpc::decode(values[i], result);
  return result;
}

std::string blob_at(Values values, std::size_t i) {
  if (i >= values.size() || values[i].type != msgpack::type::BIN) throw rpc::DecodeError("bytes are missing");
  return {values[i].via.bin.ptr, values[i].via.bin.size};
}

AnswerHash hash_at(Values values, std::size_t i) {
  const std::string bytes = blob_at(values, i);
  AnswerHash hash{};
  if (bytes.size() != hash.size()) throw rpc::DecodeError("a hash has another length");
  std::ranges::copy(bytes, hash.begin());
  return hash;
}

std::int64_t tick_at(Values values, std::size_t i) {
  const auto tick = value_at<std::int64_t>(values, i);
  if (tick < 0) throw rpc::DecodeError("a step is negative");
  if (tick > kMaxTick) throw rpc::DecodeError("it would take years");
  return tick;
}

double number_at(Values values, std::size_t i) {
  const auto number = value_at<double>(values, i);
  if (!std::isfinite(number)) throw rpc::DecodeError("a number is not finite");
  return number;
}

SessionHeader header_of(Values values) {
  if (value_at<std::string>(values, 0) != kFormat) throw rpc::DecodeError("the format's name is another");
  if (value_at<std::uint64_t>(values, 1) != kVersion)
    throw rpc::DecodeError("it is of another version of tileflight's sessions");
  return {blob_at(values, 2), blob_at(values, 3), blob_at(values, 4), blob_at(values, 5),
          value_at<std::uint64_t>(values, 6)};
}

RecordedEvent event_of(std::uint64_t number, Values values) {
  RecordedEvent record;
  AutopilotEvent& event = record.event;
  const auto kind = value_at<std::uint8_t>(values, 0);
  if (kind > static_cast<std::uint8_t>(AutopilotEvent::Kind::kSensors))
    throw rpc::DecodeError("no event of autopilots");
  event.kind = static_cast<AutopilotEvent::Kind>(kind);
  event.number = number;
  event.vehicle = value_at<std::string>(values, 1);
  event.tick = tick_at(values, 2);
  event.time_s = number_at(values, 3);
  event.step_s = number_at(values, 4);
  event.outputs = value_at<std::vector<double>>(values, 5);
  if (event.outputs.size() > kMaxOutputs) throw rpc::DecodeError("more motors than there are");
  if (!(event.step_s >= 0.0 && event.step_s <= 1.0)) throw rpc::DecodeError("a vehicle's step is above a second");
  if (event.kind == AutopilotEvent::Kind::kSensors) record.hash = hash_at(values, 6);
  return record;
}

SessionRecord record_of(const std::string& bytes) {
  const msgpack::object_handle handle = msgpack::unpack(bytes.data(), bytes.size());
  const msgpack::object_array& parts = handle.get().via.array;  // the scanner has seen an array of at least 3
  const auto kind = value_at<std::uint64_t>({parts.ptr, parts.size}, 0);
  const auto number = value_at<std::uint64_t>({parts.ptr, parts.size}, 1);
  if (parts.ptr[2].type != msgpack::type::ARRAY) throw rpc::DecodeError("no array of values");
  const Values values(parts.ptr[2].via.array.ptr, parts.ptr[2].via.array.size);
  switch (kind) {
    case kHeader:
      return header_of(values);
    case kCall:
      return RecordedCall{number, value_at<std::uint64_t>(values, 0), tick_at(values, 1), blob_at(values, 2)};
    case kAnswer:
      return RecordedAnswer{number, hash_at(values, 0), value_at<bool>(values, 1), tick_at(values, 2)};
    case kEvent:
      return event_of(number, values);
    case kLevel:
      return RecordedLevel{value_at<std::uint64_t>(values, 0)};
    case kEnd:
      return RecordedEnd{tick_at(values, 0)};
    default:
      throw rpc::DecodeError("its kind is unknown");
  }
}

}  // namespace

AnswerHash hash_of(std::string_view bytes) {
  base::Sha256 sha;
  sha.add(bytes);
  const std::string hex = sha.hex();
  AnswerHash hash{};
  for (std::size_t i = 0; i < hash.size(); ++i)
    hash[i] = static_cast<std::uint8_t>(std::stoul(hex.substr(2 * i, 2), nullptr, 16));
  return hash;
}

SessionWriter::SessionWriter(const std::filesystem::path& file, const SessionHeader& header) {
  if (std::filesystem::exists(file))
    throw InputError(file.string(), "exists already; name another file for the session, or remove it");
  stream_.open(file, std::ios::binary);
  if (!add(header)) throw InputError(file.string(), "a session cannot be written there");
}

bool SessionWriter::add(const SessionRecord& record) {
  const std::string bytes = std::visit([](const auto& one) { return encoded(one); }, record);
  const std::lock_guard lock(mutex_);
  if (ended_) return true;
  stream_.write(bytes.data(), static_cast<std::streamsize>(bytes.size())).flush();
  ended_ = !stream_ || std::holds_alternative<RecordedEnd>(record);
  return stream_.good();
}

SessionReader::SessionReader(const std::filesystem::path& file) : file_(file), stream_(file, std::ios::binary) {
  if (!stream_) throw InputError(file.string(), "cannot be read as a session of `tileflight serve --record`");
  std::optional<SessionRecord> first;
  try {
    first = next();
  } catch (const InputError&) {
    first.reset();
  }
  if (!first || !std::holds_alternative<SessionHeader>(*first))
    throw InputError(file.string(), "is no session of this version's `tileflight serve --record`");
  header_ = std::get<SessionHeader>(*first);
}

/// The bytes of the next record.
std::optional<std::string> SessionReader::next_bytes() {
  rpc::MessageScanner scanner({.max_bytes = kMaxRecordBytes, .max_values = 1000, .max_depth = 4});
  while (true) {
    if (const auto bytes = scanner.find_message_end(std::string_view(buffer_).substr(taken_))) {
      taken_ += *bytes;
      return buffer_.substr(taken_ - *bytes, *bytes);
    }
    buffer_.erase(0, taken_);
    taken_ = 0;
    const std::size_t before = buffer_.size();
    buffer_.resize(before + std::max(before, kChunkBytes));
    stream_.read(buffer_.data() + before, static_cast<std::streamsize>(buffer_.size() - before));
    buffer_.resize(before + static_cast<std::size_t>(stream_.gcount()));
    if (buffer_.size() > before) continue;
    cut_ = !buffer_.empty();
    return std::nullopt;
  }
}

std::optional<SessionRecord> SessionReader::next() {
  try {
    const auto bytes = next_bytes();
    if (!bytes) return std::nullopt;
    SessionRecord record = record_of(*bytes);
    offset_ += bytes->size();
    return record;
  } catch (const std::exception& fault) {  // of the scanner, of MessagePack, of a value
    throw InputError(file_.string(), "is damaged at byte " + std::to_string(offset_) + ": " + fault.what());
  }
}

}  // namespace tileflight::airsim
