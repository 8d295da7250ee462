#include "tileflight/live/airsim/session.h"

#include <utility>

namespace tileflight::airsim {

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
  add(RecordedAnswer{number, hash_of(answer.bytes), answer.failed, levels.current()->tick()});
  return answer;
}

void SessionRecorder::finish(const Levels& levels) {
  const ServedTurn turn(levels);
  add(RecordedEnd{turn.tick()});
}

}  // namespace tileflight::airsim
