#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <set>
#include <stop_token>
#include <string>

namespace tileflight::ros2 {

/// Makes the configuration of CycloneDDS, its networks and limits, as XML. The network is:
///
/// - `interface_name` given ("eth0", or an address of this machine): that interface alone, with multicast if it has it.
/// - else, the one that `cyclonedds_uri` (the environment's CYCLONEDDS_URI, a file or XML) says, if it is not empty;
/// - else this machine alone: 127.0.0.1, and as loopback has no multicast, other participants are looked for at the
///   first 32 ports of the domain.
///
/// In all cases a slow reader makes no writer wait: writers keep only a few messages, which bounds memory. Shared
/// memory is off. Throws InputError for an unknown interface.
std::string configuration(const std::string& interface_name, const std::string& cyclonedds_uri);

inline constexpr std::uint32_t kMaxDomain = 232;  ///< the last domain that has ports (RTPS 2.2, section 9.6.1)

/// An entity's global identifier in DDS.
using Guid = std::array<std::uint8_t, 16>;

/// Releases of ROS 2 that differ in the message by which a node describes itself.
enum class Release {
  kHumble,        ///< identifiers have 24 octets
  kIronAndLater,  ///< identifiers have 16 octets
};

/// A node with its readers and writers.
struct NodeInfo {
  std::string node_namespace = "/", name;
  std::set<Guid> readers, writers;
};

inline const std::string kDiscoveryTopic = "ros_discovery_info";
inline const std::string kDiscoveryType = "rmw_dds_common::msg::dds_::ParticipantEntitiesInfo_";

/// Encodes rmw_dds_common/msg/ParticipantEntitiesInfo of a participant with one node. It tells other nodes (`ros2 node
/// list`, `ros2 node info`) which topics belong to which node.
std::string participant_entities_info(Release release, const Guid& participant, const NodeInfo& node);

struct ParticipantOptions {
  std::uint32_t domain = 0;         ///< ROS_DOMAIN_ID, at most kMaxDomain
  std::string interface_name;       ///< see configuration()
  std::string node = "tileflight";  ///< shown by `ros2 node list`
  Release release = Release::kHumble;
};

/// A participant of a DDS domain that ROS 2's nodes take for a process with one node: it speaks as rmw_cyclonedds_cpp
/// does, and does not interpret the messages. A process has one participant in each domain. The warnings of CycloneDDS
/// are those of the whole process; they go to the log of the latest participant. Thread-safe.
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

  /// Returns the network on which others find it: "127.0.0.1 alone", the interface, or "CYCLONEDDS_URI".
  std::string network() const;

  /// Counts arrivals and departures of other participants' readers.
  std::uint64_t audience_changes() const;
  /// Waits until any publisher has a reader. Returns false if `stop` was requested.
  bool wait_for_reader(const std::stop_token& stop) const;

  // For publishers, subscriptions and services, which belong to a participant and must not outlive it.

  std::int32_t handle() const;  ///< DDS entity
  enum class Kind { kReader, kWriter };
  /// Tells others that the entity belongs to the node, or no longer does.
  void add(Kind kind, std::int32_t entity);
  void remove(Kind kind, std::int32_t entity);
  /// Counts readers of publishers that have arrived (positive) or left (negative).
  void count_readers(std::int32_t change);
  void report(const std::string& line);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tileflight::ros2
