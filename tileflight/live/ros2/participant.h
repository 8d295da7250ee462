#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <stop_token>
#include <string>

#include "tileflight/live/ros2/discovery_info.h"

namespace tileflight::ros2 {

struct ParticipantOptions {
  std::uint32_t domain = 0;         ///< ROS_DOMAIN_ID, at most kMaxDomain
  std::string interface_name;       ///< see configuration()
  std::string node = "tileflight";  ///< shown by `ros2 node list`
  Release release = Release::kHumble;
};

/// A participant of a DDS domain that ROS 2's nodes take for a process with one node: it speaks as rmw_cyclonedds_cpp
/// does, and knows nothing of what it sends. One domain has one participant in a process. CycloneDDS's warnings go to
/// the log of the participant that was made last, as they are the process's. Thread-safe.
class Participant {
 public:
  /// Receives one line for each fault, and for each warning of CycloneDDS: each line once, and a hundred lines at most.
  /// Called from any thread.
  using Log = std::function<void(const std::string& line)>;

  /// Throws InputError: no such interface, an unusable CYCLONEDDS_URI, no free port.
  explicit Participant(const ParticipantOptions& options, Log log = {});
  ~Participant();
  Participant(const Participant&) = delete;
  Participant& operator=(const Participant&) = delete;

  /// The network on which others find it: "127.0.0.1 alone", the interface, or "CYCLONEDDS_URI".
  std::string network() const;

  /// Counts arrivals and departures of other participants' readers.
  std::uint64_t audience_changes() const;
  /// Waits until any publisher has a reader. Returns false if `stop` was requested.
  bool wait_for_reader(const std::stop_token& stop) const;

  // For publishers, subscriptions and services, which belong to a participant and must not outlive it.

  std::int32_t handle() const;  ///< DDS entity
  enum class Kind { kReader, kWriter };
  /// Tells others that the entity belongs to the node, or does no more.
  void add(Kind kind, std::int32_t entity);
  void remove(Kind kind, std::int32_t entity);
  /// Readers of publishers that have arrived (positive) or left.
  void count_readers(std::int32_t change);
  void report(const std::string& line);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tileflight::ros2
