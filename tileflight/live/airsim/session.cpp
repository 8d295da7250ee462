#include "tileflight/live/airsim/session.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <future>
#include <list>
#include <map>
#include <mutex>
#include <set>
#include <span>
#include <thread>
#include <utility>

#include "tileflight/core/base/hash.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/live/rpc/codec.h"
#include "tileflight/live/rpc/message_scanner.h"
#include "tileflight/live/simulator/simulation_clock.h"

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

/// Bytes, which are written as such; other texts are UTF-8.
struct Blob {
  std::span<const std::uint8_t> bytes;
};

struct Nothing {};

Blob blob(std::string_view bytes) { return {{reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()}}; }

void encode(rpc::Encoder& out, const Blob& value) { out.binary(value.bytes); }
void encode(rpc::Encoder& out, const Nothing&) { out.nil(); }

template <class... Value>
std::string encoded_record(RecordKind kind, std::uint64_t number, const Value&... values) {
  using rpc::encode;
  rpc::Encoder out;
  out.array(3);
  encode(out, kind);
  encode(out, number);
  out.array(sizeof...(values));
  (encode(out, values), ...);
  return out.take();
}

std::string encoded(const SessionHeader& header) {
  return encoded_record(kHeader, 0, std::string(kFormat), kVersion, blob(header.program), blob(header.source),
                        blob(header.settings), blob(header.world), header.start_ns);
}

std::string encoded(const RecordedCall& call) {
  return encoded_record(kCall, call.number, call.client, call.tick, blob(call.message));
}

std::string encoded(const RecordedAnswer& answer) {
  return encoded_record(kAnswer, answer.call, Blob{answer.hash}, answer.failed, answer.tick);
}

std::string encoded(const RecordedEvent& record) {
  const AutopilotEvent& event = record.event;
  const auto with = [&event](const auto& hash) {
    return encoded_record(kEvent, event.number, event.kind, event.vehicle, event.tick, event.time_s, event.step_s,
                          event.outputs, hash);
  };
  return event.kind == AutopilotEvent::Kind::kSensors ? with(Blob{record.hash}) : with(Nothing{});
}

std::string encoded(const RecordedLevel& level) { return encoded_record(kLevel, 0, level.start_ns); }

std::string encoded(const RecordedEnd& end) { return encoded_record(kEnd, 0, end.tick); }

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

namespace {

/// Calls whose answers say how fast the machine is.
const std::set<std::string, std::less<>> kOfTheMachine{"tfStatistics", "tfGroundTruth"};

/// Answers of the session and of its repetition, which come in any order. Thread-safe.
class AnswerComparison {
 public:
  void expect(std::uint64_t call, const AnswerHash& hash) { meet(call, hash, expected_, repeated_); }
  void repeat(const SessionDifference& call, const AnswerHash& hash) {
    {
      const std::lock_guard lock(mutex_);
      calls_.emplace(call.call, call);
    }
    meet(call.call, hash, repeated_, expected_);
  }
  /// Counts a comparison that has no call number.
  void compare(const SessionDifference& where, bool equal) {
    const std::lock_guard lock(mutex_);
    count(where, equal);
  }
  void add_to(ReplayResult& result) const {
    const std::lock_guard lock(mutex_);
    result.answers_compared = compared_;
    result.differences = differences_;
    result.first_difference = first_;
  }

 private:
  using Hashes = std::map<std::uint64_t, AnswerHash>;

  void meet(std::uint64_t call, const AnswerHash& hash, Hashes& own, Hashes& other) {
    const std::lock_guard lock(mutex_);
    const auto partner = other.find(call);
    if (partner == other.end()) {
      own.emplace(call, hash);
      return;
    }
    const auto where = calls_.find(call);
    if (where != calls_.end()) {
      if (!kOfTheMachine.contains(where->second.what)) count(where->second, partner->second == hash);
      calls_.erase(where);
    }
    other.erase(partner);
  }
  void count(const SessionDifference& where, bool equal) {
    ++compared_;
    if (equal) return;
    ++differences_;
    if (!first_ || where.tick < first_->tick || (where.tick == first_->tick && where.call < first_->call))
      first_ = where;
  }

  mutable std::mutex mutex_;
  Hashes expected_, repeated_;
  std::map<std::uint64_t, SessionDifference> calls_;
  std::uint64_t compared_ = 0, differences_ = 0;
  std::optional<SessionDifference> first_;
};

/// Calls that are being made, each by its own thread, since some wait until time has gone on.
class RunningCalls {
 public:
  RunningCalls(Levels& levels, const rpc::MethodTable& methods, AnswerComparison& answers)
      : levels_(levels), methods_(methods), answers_(answers) {}
  /// Ends calls that wait still, as the session's end did.
  ~RunningCalls() { levels_.stop(); }
  RunningCalls(const RunningCalls&) = delete;
  RunningCalls& operator=(const RunningCalls&) = delete;

  /// Begins a call; returns when it is over, or waits for the simulation.
  void begin(const RecordedCall& call) {
    std::erase_if(running_, [](const Running& one) { return one.is_done->load(); });
    if (running_.size() >= kMostRunning)
      throw InputError("session", "has more calls that wait at once than a server takes; the file is damaged");
    std::promise<void> begun;
    std::future<void> has_turn = begun.get_future();
    auto is_done = std::make_shared<std::atomic<bool>>(false);
    const std::shared_ptr<simulator::Simulator> world = levels_.current();
    running_.push_back({std::jthread([this, call, is_done, begun = std::move(begun)]() mutable {
                          make(call, begun);
                          is_done->store(true);
                        }),
                        is_done});
    has_turn.wait();
    const simulator::Simulator::Turn next(*world);
  }

 private:
  /// A server has at most 256 threads for calls (rpc::ServerLimits); here some that are over may still end.
  static constexpr std::size_t kMostRunning = 1024;

  struct Running {
    std::jthread thread;
    std::shared_ptr<std::atomic<bool>> is_done;
  };

  void make(const RecordedCall& call, std::promise<void>& begun) {
    SessionDifference where{call.number, call.client, call.tick, {}};
    rpc::Response answer;
    {
      const ServedTurn turn(levels_);
      begun.set_value();
      try {
        const rpc::Request request(call.message);
        where.what = request.method();
        answer = methods_.call(request);
      } catch (const rpc::ProtocolError&) {
        answer.bytes = "no call";  // of a damaged file: no answer equals it
      }
    }
    answers_.repeat(where, hash_of(answer.bytes));
  }

  Levels& levels_;
  const rpc::MethodTable& methods_;
  AnswerComparison& answers_;
  std::list<Running> running_;
};

/// Repeats what autopilots did.
void repeat(const RecordedEvent& record, simulator::Simulator& world, AnswerComparison& answers) {
  const simulator::AutopilotEvent& event = record.event;
  const std::string bytes = world.apply(event);
  if (event.kind != simulator::AutopilotEvent::Kind::kSensors) return;
  answers.compare({0, 0, event.tick, "sensors of " + event.vehicle}, hash_of(bytes) == record.hash);
}

}  // namespace

SessionSummary summarize_session(const std::filesystem::path& file) {
  SessionReader reader(file);
  SessionSummary summary{.header = reader.header()};
  while (const auto record = reader.next()) {
    ++summary.records;
    if (const auto* level = std::get_if<RecordedLevel>(&*record)) summary.level_starts_ns.push_back(level->start_ns);
  }
  summary.is_cut = reader.is_cut();
  return summary;
}

ReplayResult replay_session(const std::filesystem::path& file, std::uint64_t records, Levels& levels,
                            const rpc::MethodTable& methods, const Progress& progress) {
  ReplayResult result;
  SessionReader reader(file);
  AnswerComparison answers;
  {
    RunningCalls calls(levels, methods, answers);
    std::int64_t done = 0;
    while (const auto record = reader.next()) {
      const std::shared_ptr<simulator::Simulator> world = levels.current();
      if (const auto* call = std::get_if<RecordedCall>(&*record)) {
        world->clock().advance_to(call->tick);
        calls.begin(*call);
        ++result.calls;
      } else if (const auto* answer = std::get_if<RecordedAnswer>(&*record)) {
        world->clock().advance_to(answer->tick);
        answers.expect(answer->call, answer->hash);
      } else if (const auto* event = std::get_if<RecordedEvent>(&*record)) {
        world->clock().advance_to(event->event.tick);
        repeat(*event, *world, answers);
        ++result.autopilot_events;
      } else if (const auto* end = std::get_if<RecordedEnd>(&*record)) {
        world->clock().advance_to(end->tick);
      }
      report_progress(progress, ++done, static_cast<std::int64_t>(records), "repeating the session");
    }
    result.simulated_s = static_cast<double>(levels.current()->clock().tick()) * simulator::SimulationClock::kStep_s;
  }
  answers.add_to(result);
  return result;
}

/// Another call may have loaded a level while this one waited.
ServedTurn::ServedTurn(const Levels& levels) {
  do {
    turn_.reset();
    world_ = levels.current();
    turn_.emplace(*world_);
  } while (world_ != levels.current());
}

SessionRecorder::SessionRecorder(const std::filesystem::path& file, const SessionHeader& header,
                                 simulator::SimulatorLog log)
    : file_(file.string()), log_(std::move(log)), writer_(file, header) {}

void SessionRecorder::add(const SessionRecord& record) {
  if (writer_.add(record) || !log_) return;
  log_(file_ + ": cannot be written any more; the session is recorded up to here (is the disk full?)");
}

simulator::AutopilotJournal SessionRecorder::journal() {
  return [this](const simulator::AutopilotEvent& event) {
    RecordedEvent record{event, hash_of(event.bytes)};
    record.event.bytes.clear();
    add(record);
  };
}

void SessionRecorder::begin_level(std::uint64_t start_ns) { add(RecordedLevel{start_ns}); }

rpc::Response SessionRecorder::call(Levels& levels, const rpc::MethodTable& methods, std::uint64_t client,
                                    const rpc::Request& request) {
  std::uint64_t number = 0;
  rpc::Response answer;
  {
    const ServedTurn turn(levels);
    number = calls_++;
    add(RecordedCall{number, client, turn.tick(), request.message()});
    answer = methods.call(request);
  }
  add(RecordedAnswer{number, hash_of(answer.bytes), answer.failed, levels.current()->clock().tick()});
  return answer;
}

void SessionRecorder::finish(const Levels& levels) {
  const ServedTurn turn(levels);
  add(RecordedEnd{turn.tick()});
}

}  // namespace tileflight::airsim
