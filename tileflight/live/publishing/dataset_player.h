#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "tileflight/data/messages/dataset_messages.h"
#include "tileflight/live/foxglove/messages.h"
#include "tileflight/live/publishing/message_sink.h"
#include "tileflight/live/publishing/place_glb.h"

namespace tileflight::publishing {

/// Computes when the messages of a recording are due: it relates recorded time to the wall clock, at a rate that may
/// change, and with pauses. The wall clock's time is passed in. Not thread-safe.
class PlaybackClock {
 public:
  using WallTime = std::chrono::steady_clock::time_point;

  PlaybackClock(double rate, bool is_paused) : rate_(rate), is_paused_(is_paused) {}

  /// Sets the recorded time at `now`.
  void set_time(std::int64_t time_ns, WallTime now);
  /// Sets the rate from `now` on: recorded seconds per second, above zero.
  void set_rate(double rate, WallTime now);
  void set_paused(bool is_paused, WallTime now);
  double rate() const { return rate_; }
  bool is_paused() const { return is_paused_; }

  std::int64_t time_ns(WallTime now) const;
  /// Returns the time of the wall clock at this recorded time; nullopt while paused.
  std::optional<WallTime> due(std::int64_t time_ns) const;

 private:
  double rate_;
  bool is_paused_;
  std::int64_t anchor_ns_ = 0;  ///< recorded time at `anchor_`
  WallTime anchor_{};
};

struct PlayOptions {
  double rate = 1.0;       ///< recorded seconds per second, above zero and at most kMaxPlayRate
  bool loop = false;       ///< begin again at the end
  bool is_paused = false;  ///< wait for a viewer to set the parameter `paused` to false
  /// Names of the rig's cameras to play (MessageSelection::cameras).
  std::vector<std::string> cameras{};
  std::optional<double> epoch_s{};  ///< MessageSelection::epoch_s
};
inline constexpr double kMaxPlayRate = 1000.0;

/// Plays a dataset, of one camera or a rig, to viewers and nodes: the messages of list_messages() with depth, odometry
/// and /tf_static, /clock, the whole true path (of a rig: the first camera's) as /path and the place as /place (both
/// sent once to each viewer), at the dataset's times, moved by `epoch_s`. Only what a viewer has subscribed to is read.
class DatasetPlayer {
 public:
  /// `rig` must outlive the player. Throws InputError: files that cannot be read, no messages.
  DatasetPlayer(const dataset::Rig& rig, const PlayOptions& options);

  /// The parameters `rate`, `paused` and `loop`, which viewers may set.
  foxglove::ParameterAccess parameters();

  /// Adds the channels. `place`: what is shown as /place.
  void open(MessageSink& sink, const std::optional<PlaceGlb>& place);
  std::vector<std::string> topics() const;
  double duration_s() const;
  /// Returns one line for each choice that was made for the user (DatasetMessages::notes).
  const std::vector<std::string>& notes() const { return listed_.notes; }

  /// Waits for the first subscription, then plays until the end (with `loop`: for ever) or until `stop`. Returns the
  /// number of messages sent. Throws InputError for a file that cannot be read.
  std::uint64_t play(MessageSink& sink, const std::stop_token& stop);

 private:
  void set_parameter(const foxglove::Parameter& wanted);
  bool is_looping() const;
  void restart_clock();
  /// Waits until a message is due. Returns false if `stop` came first.
  bool wait_until_due(std::int64_t time_ns, const std::stop_token& stop);
  std::uint64_t play_once(MessageSink& sink, const std::stop_token& stop);

  const dataset::Dataset& dataset_;  ///< the first camera's
  messages::DatasetMessages listed_;
  std::vector<MessageSink::ChannelId> channels_;  ///< of each topic
  MessageSink::ChannelId clock_channel_ = 0;
  std::vector<std::string> topics_;  ///< all, with those that are sent once
  mutable std::mutex mutex_;         ///< guards the members below
  std::condition_variable_any changed_;
  PlaybackClock clock_;
  bool loop_;
};

}  // namespace tileflight::publishing
