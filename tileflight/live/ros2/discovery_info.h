#pragma once

#include <array>
#include <cstdint>
#include <set>
#include <string>

namespace tileflight::ros2 {

/// An entity's global identifier in DDS.
using Guid = std::array<std::uint8_t, 16>;

/// ROS 2's releases differ in what a node tells of itself.
enum class Release {
  kHumble,        ///< identifiers have 24 octets
  kIronAndLater,  ///< identifiers have 16 octets
};

/// A node and what belongs to it.
struct NodeInfo {
  std::string node_namespace = "/", name;
  std::set<Guid> readers, writers;
};

inline const std::string kDiscoveryTopic = "ros_discovery_info";
inline const std::string kDiscoveryType = "rmw_dds_common::msg::dds_::ParticipantEntitiesInfo_";

/// rmw_dds_common/msg/ParticipantEntitiesInfo of a participant with one node, encoded: from it other nodes know
/// (`ros2 node list`, `ros2 node info`) which topics belong to which node.
std::string participant_entities_info(Release release, const Guid& participant, const NodeInfo& node);

}  // namespace tileflight::ros2
