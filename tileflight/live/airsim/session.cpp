#include "tileflight/live/airsim/session.h"

#include <atomic>
#include <future>
#include <list>
#include <map>
#include <mutex>
#include <set>
#include <thread>
#include <utility>

#include "tileflight/core/base/input_error.h"
#include "tileflight/live/rpc/message_scanner.h"
#include "tileflight/live/simulator/simulation_clock.h"

namespace tileflight::airsim {

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
  /// Of what has no number.
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
        world->advance_to(call->tick);
        calls.begin(*call);
        ++result.calls;
      } else if (const auto* answer = std::get_if<RecordedAnswer>(&*record)) {
        world->advance_to(answer->tick);
        answers.expect(answer->call, answer->hash);
      } else if (const auto* event = std::get_if<RecordedEvent>(&*record)) {
        world->advance_to(event->event.tick);
        repeat(*event, *world, answers);
        ++result.autopilot_events;
      } else if (const auto* end = std::get_if<RecordedEnd>(&*record)) {
        world->advance_to(end->tick);
      }
      report_progress(progress, ++done, static_cast<std::int64_t>(records), "repeating the session");
    }
    result.simulated_s = static_cast<double>(levels.current()->tick()) * simulator::SimulationClock::kStep_s;
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
  add(RecordedAnswer{number, hash_of(answer.bytes), answer.failed, levels.current()->tick()});
  return answer;
}

void SessionRecorder::finish(const Levels& levels) {
  const ServedTurn turn(levels);
  add(RecordedEnd{turn.tick()});
}

}  // namespace tileflight::airsim
