#include "tileflight/live/publishing/dataset_player.h"

#include <cmath>
#include <utility>

#include "tileflight/core/base/input_error.h"
#include "tileflight/data/messages/ros_messages.h"
#include "tileflight/live/publishing/viewer_channels.h"

namespace tileflight::publishing {

void PlaybackClock::set_time(std::int64_t time_ns, WallTime now) {
  anchor_ns_ = time_ns;
  anchor_ = now;
}

void PlaybackClock::set_rate(double rate, WallTime now) {
  set_time(time_ns(now), now);
  rate_ = rate;
}

void PlaybackClock::set_paused(bool is_paused, WallTime now) {
  set_time(time_ns(now), now);
  is_paused_ = is_paused;
}

std::int64_t PlaybackClock::time_ns(WallTime now) const {
  if (is_paused_) return anchor_ns_;
  const std::chrono::duration<double, std::nano> passed = now - anchor_;
  return anchor_ns_ + std::llround(passed.count() * rate_);
}

std::optional<PlaybackClock::WallTime> PlaybackClock::due(std::int64_t time_ns) const {
  if (is_paused_) return std::nullopt;
  const double wall_ns = static_cast<double>(time_ns - anchor_ns_) / rate_;
  return anchor_ + std::chrono::nanoseconds(std::llround(wall_ns));
}

namespace {

using WallClock = std::chrono::steady_clock;

constexpr std::size_t kMaxPathPoses = 10000;

/// The true poses; of very many, some.
std::vector<geometry::StampedPose> drawn_path(const geometry::Trajectory& truth) {
  const std::size_t step = truth.size() / kMaxPathPoses + 1;
  std::vector<geometry::StampedPose> poses;
  for (std::size_t i = 0; i < truth.size(); i += step) poses.push_back(truth.poses[i]);
  return poses;
}

bool truth_value(const foxglove::Parameter& wanted) {
  if (const auto* value = std::get_if<bool>(&wanted.value)) return *value;
  throw InputError(wanted.name, "must be true or false");
}

double rate_value(const foxglove::Parameter& wanted) {
  const auto* value = std::get_if<double>(&wanted.value);
  if (value == nullptr || !(*value > 0.0) || *value > kMaxPlayRate)
    throw InputError(wanted.name, "must be a number above 0, and 1000 at most");
  return *value;
}

}  // namespace

DatasetPlayer::DatasetPlayer(const dataset::Rig& rig, const PlayOptions& options)
    : dataset_(rig.cameras.front().dataset),
      listed_(messages::list_messages(rig, {.depth = true,
                                            .odometry = true,
                                            .static_transforms = true,
                                            .epoch_s = options.epoch_s,
                                            .cameras = options.cameras})),
      clock_(options.rate, options.is_paused),
      loop_(options.loop) {
  if (listed_.messages.empty()) throw InputError(dataset_.folder.string(), "holds nothing to play");
}

foxglove::ParameterAccess DatasetPlayer::parameters() {
  foxglove::ParameterAccess access;
  access.read = [this] {
    const std::lock_guard lock(mutex_);
    return std::vector<foxglove::Parameter>{{"rate", clock_.rate()}, {"paused", clock_.is_paused()}, {"loop", loop_}};
  };
  access.write = [this](const foxglove::Parameter& wanted) { set_parameter(wanted); };
  return access;
}

void DatasetPlayer::set_parameter(const foxglove::Parameter& wanted) {
  const std::lock_guard lock(mutex_);
  const auto now = WallClock::now();
  if (wanted.name == "rate") {
    clock_.set_rate(rate_value(wanted), now);
  } else if (wanted.name == "paused") {
    clock_.set_paused(truth_value(wanted), now);
  } else if (wanted.name == "loop") {
    loop_ = truth_value(wanted);
  } else {
    throw InputError(wanted.name.substr(0, 100), "is no parameter here; there are rate, paused and loop");
  }
  changed_.notify_all();
}

void DatasetPlayer::open(MessageSink& sink, const std::optional<PlaceGlb>& place) {
  for (const messages::MessageTopic& topic : listed_.topics) {
    channels_.push_back(sink.add_channel(ros_channel(topic.name, topic.type, topic.is_latched)));
    topics_.push_back(topic.name);
  }
  clock_channel_ = sink.add_channel(ros_channel("/clock", "rosgraph_msgs/msg/Clock"));
  topics_.emplace_back("/clock");
  const std::int64_t begin_ns = listed_.messages.front().time_ns;
  const auto send_once = [&](foxglove::Channel channel, std::string bytes) {
    topics_.push_back(channel.topic);
    sink.publish(sink.add_channel(std::move(channel)), static_cast<std::uint64_t>(begin_ns), std::move(bytes));
  };
  if (dataset_.groundtruth)
    send_once(
        ros_channel("/path", "nav_msgs/msg/Path", true),
        messages::ros::path({begin_ns, messages::kMapFrame}, drawn_path(*dataset_.groundtruth), listed_.epoch_ns));
  if (place)
    send_once(scene_channel("/place"), scene_update(place->bytes, messages::kMapFrame,
                                                    static_cast<std::uint64_t>(begin_ns), place->attribution));
}

std::vector<std::string> DatasetPlayer::topics() const { return topics_; }

double DatasetPlayer::duration_s() const {
  return static_cast<double>(listed_.messages.back().time_ns - listed_.messages.front().time_ns) * 1e-9;
}

std::uint64_t DatasetPlayer::play(MessageSink& sink, const std::stop_token& stop) {
  if (!sink.wait_for_audience(stop)) return 0;
  std::uint64_t sent = 0;
  do {
    sent += play_once(sink, stop);
  } while (!stop.stop_requested() && is_looping());
  return sent;
}

std::uint64_t DatasetPlayer::play_once(MessageSink& sink, const std::stop_token& stop) {
  restart_clock();
  std::uint64_t sent = 0;
  for (const messages::DatasetMessage& message : listed_.messages) {
    if (!wait_until_due(message.time_ns, stop)) break;
    const auto time_ns = static_cast<std::uint64_t>(message.time_ns);
    sink.publish_time(time_ns);
    if (sink.is_wanted(clock_channel_)) sink.publish(clock_channel_, time_ns, messages::ros::clock(message.time_ns));
    const MessageSink::ChannelId channel = channels_[message.topic];
    const bool is_wanted = sink.is_wanted(channel);
    if (!is_wanted && !listed_.topics[message.topic].is_latched) continue;
    sink.publish(channel, time_ns, message.make());
    if (is_wanted) ++sent;
  }
  return sent;
}

bool DatasetPlayer::is_looping() const {
  const std::lock_guard lock(mutex_);
  return loop_;
}

void DatasetPlayer::restart_clock() {
  const std::lock_guard lock(mutex_);
  clock_.set_time(listed_.messages.front().time_ns, WallClock::now());
}

bool DatasetPlayer::wait_until_due(std::int64_t time_ns, const std::stop_token& stop) {
  std::unique_lock lock(mutex_);
  while (!stop.stop_requested()) {
    const std::optional<PlaybackClock::WallTime> due = clock_.due(time_ns);
    if (due && *due <= WallClock::now()) return true;
    const auto is_changed = [this, due, time_ns] { return clock_.due(time_ns) != due; };
    if (due) {
      changed_.wait_until(lock, stop, *due, is_changed);
    } else {
      changed_.wait(lock, stop, is_changed);
    }
  }
  return false;
}

}  // namespace tileflight::publishing
